//! Damaged files: an error or a motion, never a panic.

use std::path::Path;

use proptest::prelude::*;

use super::tests::{AMC, ASF, BVH, TRC, c3d};
use super::*;

const CSV: &str = "# rate: 50\ntime,L.x,L.y,L.z,R.x,R.y,R.z\n0,1,2,3,4,5,6\n0.02,1,2,3,4,5,6\n0.04,,,,7,8,9\n";

/// Every reader by number, on bytes.
fn read(reader: usize, bytes: &[u8]) -> Result<Motion> {
    let path = Path::new("fuzz");
    let text = String::from_utf8_lossy(bytes);
    match reader {
        0 => c3d::parse(bytes, path),
        1 => trc::parse(&text, path),
        2 => csv::parse(&text, path),
        3 => bvh::parse(&text, path),
        4 => acclaim_skeleton::parse(&text, path).and_then(|bones| acclaim::parse(AMC, path, bones)),
        _ => acclaim_skeleton::parse(ASF, path).and_then(|bones| acclaim::parse(&text, path, bones)),
    }
}

fn examples() -> Vec<(usize, Vec<u8>)> {
    let mut examples: Vec<_> = [84, 85, 86].iter().flat_map(|&k| [(0, c3d(k, false)), (0, c3d(k, true))]).collect();
    for (reader, text) in [(1, TRC), (2, CSV), (3, BVH), (4, ASF), (5, AMC)] {
        examples.push((reader, text.into()));
    }
    examples
}

/// What callers rely on.
fn check(motion: &Motion) {
    assert!(!motion.names.is_empty() && !motion.frames.is_empty());
    assert!(motion.rate.is_finite() && motion.rate > 0.0);
    assert!(motion.frames.iter().all(|f| f.len() == motion.names.len()));
    assert!(motion.frames.iter().flatten().flatten().all(|p| p.is_finite()));
    assert_eq!(motion.names.iter().collect::<HashSet<_>>().len(), motion.names.len());
    if let Some(skeleton) = &motion.skeleton {
        assert_eq!((skeleton.rest.len(), skeleton.rotations.len()), (motion.names.len(), motion.frames.len()));
    }
}

#[test]
fn truncation_at_every_byte_is_an_error_or_a_motion() {
    for (reader, bytes) in examples() {
        check(&read(reader, &bytes).unwrap());
        for length in 0..bytes.len() {
            match read(reader, &bytes[..length]) {
                Ok(motion) => {
                    check(&motion);
                    // Binary files and counted frames cannot be complete before their end, but for
                    // digits lost at the very end of the text.
                    assert!(reader != 0, "C3D cut at {length} of {}", bytes.len());
                }
                Err(error) => assert!(error.to_string().contains("fuzz"), "{error}"),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_bytes_are_refused_or_read(reader in 0..6usize, bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        if let Ok(motion) = read(reader, &bytes) {
            check(&motion);
        }
        // With the opening mark, so that more than the first test is reached.
        let mut marked: Vec<u8> = match reader {
            0 => c3d(84, false)[..516].to_vec(),
            1 => TRC.lines().take(4).flat_map(|l| [l, "\n"]).collect::<String>().into(),
            2 => "time,a.x,a.y,a.z\n".into(),
            3 => BVH.lines().take(18).flat_map(|l| [l, "\n"]).collect::<String>().into(),
            4 => ":bonedata\n".into(),
            _ => "1\n".into(),
        };
        marked.extend(&bytes);
        if let Ok(motion) = read(reader, &marked) {
            check(&motion);
        }
    }

    #[test]
    fn changed_bytes_are_refused_or_read(
        example in 0..11usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (reader, mut bytes) = examples().swap_remove(example);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok(motion) = read(reader, &bytes) {
            check(&motion);
        }
    }

    #[test]
    fn words_in_any_order_are_refused_or_read(
        reader in 1..6usize,
        words in proptest::collection::vec(
            prop::sample::select(vec![
                "HIERARCHY", "ROOT", "JOINT", "End", "Site", "{", "}", "OFFSET", "CHANNELS", "3", "Xrotation", "Yposition", "MOTION", "Frames:", "Frame",
                "Time:", "0.1", "1e300", "-7", "nan", "\n", "\n", ":root", ":bonedata", ":hierarchy", "begin", "end", "name", "upper", "root", "dof",
                "rx", "length", ",", "\t", "time", "a.x", "a.y", "a.z", "PathFileType", "NumFrames",
            ]),
            0..200,
        ),
    ) {
        if let Ok(motion) = read(reader, words.join(" ").as_bytes()) {
            check(&motion);
        }
    }
}
