//! Readers against files whose content is known.

use std::f64::consts::FRAC_1_SQRT_2;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::*;

fn close(a: DVec3, b: [f64; 3]) -> bool {
    a.distance(DVec3::from(b)) < 1e-9
}

/// A file of `kind` (84, 85, 86) with four points over three frames at 50 Hz: M1 moves, M2 has a
/// gap in frame 1, the third is an angle, the fourth has no label. Two analog values a frame.
pub(in crate::io) fn c3d(kind: u8, integers: bool) -> Vec<u8> {
    let word = |x: u16| if kind == 86 { x.to_be_bytes() } else { x.to_le_bytes() };
    let float = |x: f32| -> [u8; 4] {
        match kind {
            84 => x.to_le_bytes(),
            86 => x.to_be_bytes(),
            _ => {
                let [a, b, c, d] = (x * 4.0).to_le_bytes();
                [c, d, a, b]
            }
        }
    };
    let record = |id: i8, name: &str, body: &[u8]| {
        let mut bytes = vec![name.len() as u8, id as u8];
        bytes.extend(name.as_bytes());
        bytes.extend(word(body.len() as u16 + 2));
        bytes.extend(body);
        bytes
    };
    let texts = |texts: &[&str]| {
        let mut body = vec![0xff, 2, 4, texts.len() as u8];
        body.extend(texts.iter().flat_map(|t| format!("{t:4}").into_bytes()));
        body.push(0);
        body
    };
    let number = |x: f32| [&[4, 0][..], &float(x), &[0]].concat();
    let scale: f32 = if integers { 0.25 } else { -0.25 };
    let mut parameters = vec![1, 0x50, 1, kind];
    parameters.extend(record(-1, "POINT", &[0]));
    parameters.extend(record(1, "LABELS", &texts(&["M1", "M2"])));
    parameters.extend(record(1, "LABELS2", &texts(&["Ang"])));
    parameters.extend(record(1, "ANGLES", &texts(&["Ang"])));
    parameters.extend(record(1, "UNITS", &texts(&["mm"])));
    parameters.extend(record(1, "SCALE", &number(scale)));
    parameters.extend(record(1, "RATE", &number(50.0)));
    parameters.push(0);
    let mut header = vec![2, 0x50];
    for x in [4, 2, 7, 9, 0] {
        header.extend(word(x));
    }
    header.extend(float(scale));
    header.extend(word(3));
    header.extend(word(1));
    header.extend(float(50.0));
    header.resize(512, 0);
    parameters.resize(512, 0);
    let mut bytes = [header, parameters].concat();
    for f in 0..3 {
        for k in 0..4 {
            let gap = k == 1 && f == 1;
            let values = [k as f32 + 0.25, f as f32 + 0.5, -1.0, if gap { -1.0 } else { 0.0 }];
            for (axis, x) in values.into_iter().enumerate() {
                match (integers, axis) {
                    (true, 3) => bytes.extend(word(x as i16 as u16)),
                    (true, _) => bytes.extend(word((x / scale) as i16 as u16)),
                    (false, _) => bytes.extend(float(x)),
                }
            }
        }
        for _ in 0..2 {
            bytes.extend(if integers { word(7).to_vec() } else { float(7.0).to_vec() });
        }
    }
    bytes
}

#[test]
fn c3d_of_all_machines_is_read() {
    for kind in [84, 85, 86] {
        for integers in [false, true] {
            let motion = c3d::parse(&c3d(kind, integers), Path::new("a.c3d")).unwrap();
            assert_eq!(motion.names, ["M1", "M2", "point 2"], "{kind} {integers}");
            assert_eq!((motion.rate, motion.metres_per_unit, motion.frames.len()), (50.0, Some(0.001), 3));
            for (f, frame) in motion.frames.iter().enumerate() {
                assert_eq!(frame[0], Some(DVec3::new(0.25, f as f64 + 0.5, -1.0)), "{kind} {integers}");
                assert_eq!(frame[1].is_some(), f != 1);
                assert_eq!(frame[2].unwrap().x, 3.25);
            }
            assert!(motion.warnings.iter().any(|w| w.starts_with("1 points are angles")), "{:?}", motion.warnings);
        }
    }
}

#[test]
fn c3d_faults_are_named() {
    let good = c3d(84, false);
    let changed = |change: fn(&mut Vec<u8>)| {
        let mut bytes = good.clone();
        change(&mut bytes);
        c3d::parse(&bytes, Path::new("a.c3d")).unwrap_err().to_string()
    };
    for (message, expected) in [
        (changed(|b| b[1] = 0), "second byte"),
        (changed(|b| b.truncate(300)), "header is cut"),
        (changed(|b| b.truncate(1200)), "ends in frame 2 of 3"),
        (changed(|b| b[515] = 7), "7 is not a kind"),
        (changed(|b| b[2] = 0), "no points"),
        (changed(|b| b[8..10].copy_from_slice(&[1, 0])), "no frames"),
        (changed(|b| b[16..18].copy_from_slice(&[255, 0])), "block 255"),
        (changed(|b| b[0] = 200), "cut or damaged"),
    ] {
        assert!(message.contains(expected) && message.contains("a.c3d"), "{message}");
    }
}

#[test]
fn long_c3d_clips_count_frames_in_their_parameters() {
    let mut bytes = c3d(84, false);
    // The header says 65,535, which is all it can; TRIAL says frames 7 to 9.
    bytes[8..10].copy_from_slice(&[0xff, 0xff]);
    let end = 512 + bytes[512..1024].iter().rposition(|&b| b != 0).unwrap() + 2;
    let mut trial = vec![5, 0xfe];
    trial.extend(b"TRIAL\x03\x00\x00");
    for (name, value) in [("ACTUAL_START_FIELD", 7u8), ("ACTUAL_END_FIELD", 9)] {
        trial.extend([name.len() as u8, 2]);
        trial.extend(name.as_bytes());
        trial.extend([10, 0, 2, 1, 2, value, 0, 0, 0, 0]);
    }
    // The last record before the end mark is a float parameter with an empty description.
    bytes[end..end + trial.len()].copy_from_slice(&trial);
    let motion = c3d::parse(&bytes, Path::new("a.c3d")).unwrap();
    assert_eq!(motion.frames.len(), 3);
}

pub(in crate::io) const TRC: &str = "PathFileType\t4\t(X/Y/Z)\ta.trc\n\
    DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n100.00\t100.00\t3\t2\tm\t100\n\
    Frame#\tTime\tLKNE\t\t\tRKNE\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n\
    1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t\t\t\t4.5\t5\t6\n3\t0.02\t1\t2\t3.5\n";

#[test]
fn trc_is_read() {
    let motion = trc::parse(TRC, Path::new("a.trc")).unwrap();
    assert_eq!((motion.names.join(" "), motion.rate, motion.metres_per_unit), ("LKNE RKNE".into(), 100.0, Some(1.0)));
    assert_eq!(motion.frames[0][1], Some(DVec3::new(4.0, 5.0, 6.0)));
    assert_eq!((motion.frames[1][0], motion.frames[2][1]), (None, None));
    assert_eq!(motion.frames[2][0], Some(DVec3::new(1.0, 2.0, 3.5)));
    for (text, expected) in [
        (TRC.replace("4.5", "4,5"), "line 8: marker RKNE: \"4,5\""),
        (TRC.replace("\t3\t2\tm", "\t4\t2\tm"), "counts 4 frames, there are 3"),
        (TRC.replace("3.5", "3.5\t1\t1\t1\t9"), "line 9: 9 cells"),
        (TRC.lines().take(3).collect::<Vec<_>>().join("\n"), "line 4"),
        ("time,x".to_owned(), "PathFileType"),
    ] {
        let message = trc::parse(&text, Path::new("a.trc")).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn csv_is_read_wide_and_long() {
    // Times rounded to milliseconds at 120 Hz, one frame dropped.
    let wide = "# units: cm\ntime,L.x,L.y,L.z,R X,R Y,R Z\n0.000,1,2,3,4,5,6\n0.008,1,2,3,,,\n0.025,7,8,9,4,5,6\n0.033,0,0,1,4,5,6\n";
    let motion = csv::parse(wide, Path::new("a.csv")).unwrap();
    assert_eq!((motion.names.join(" "), motion.frames.len(), motion.metres_per_unit), ("L R".into(), 5, Some(0.01)));
    assert!((motion.rate - 120.0).abs() < 2.0, "{}", motion.rate);
    assert_eq!((motion.frames[1][1], motion.frames[2][0]), (None, None));
    assert_eq!(motion.frames[3][0], Some(DVec3::new(7.0, 8.0, 9.0)));

    let long = "# rate = 25\nFrame;Marker;X;Y;Z\n11;A;1;2;3\n10;A;0;0;1\n10;B;5;5;5\n13;B;6;6;6\n";
    let motion = csv::parse(long, Path::new("b.csv")).unwrap();
    assert_eq!((motion.names.join(" "), motion.frames.len(), motion.rate), ("A B".into(), 4, 25.0));
    assert_eq!(motion.frames[0], [Some(DVec3::Z), Some(DVec3::splat(5.0))]);
    assert_eq!((motion.frames[2].clone(), motion.frames[3][1]), (vec![None; 2], Some(DVec3::splat(6.0))));

    let message = |text: &str| csv::parse(text, Path::new("c.csv")).unwrap_err().to_string();
    for (text, expected) in [
        ("", "no header"),
        ("time,a,b\n", "no marker"),
        ("time,a.x,a.y\n0,1,2\n", "lacks one of its columns"),
        ("time,a.x,a.y,a.z\n", "no frames"),
        ("time,a.x,a.y,a.z\n0,1,2,three\n", "line 2: marker a"),
        ("time,a.x,a.y,a.z\n0,1,2,3,4\n", "decimal point"),
        ("time,a.x,a.y,a.z\n0,1,2,3\n1,1,2,3\n2,1,2,3\n3.5,1,2,3\n", "line 5: 3.5 after 2"),
        ("frame,marker,x,y,z\n1,a,1,2,3\n1,a,1,2,3\n", "twice in frame 0"),
        ("marker,x,y,z\na,1,2,3\n", "frame number or a time"),
        ("frame,marker,x,y,z\n0,a,1,2,3\n99999999999,a,1,2,3\n", "not evenly"),
    ] {
        assert!(message(text).contains(expected), "{}", message(text));
    }
}

/// An arm along x: an elbow at distance 2, a hand 1 further.
pub(in crate::io) const BVH: &str = "HIERARCHY\nROOT Upper Arm\n{\n OFFSET 0 0 5\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n JOINT Elbow\n {\n  OFFSET 2 0 0\n  \
    CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 1 0 0\n  }\n }\n}\nMOTION\nFrames: 3\nFrame Time: 0.04\n\
    0 0 0 0 0 0 0 0 0\n1 2 3 90 0 0 0 0 0\n0 0 0 0 90 0 90 0 45\n";

#[test]
fn bvh_moves_as_computed_by_hand() {
    let mut motion = bvh::parse(BVH, Path::new("a.bvh")).unwrap();
    assert_eq!(motion.names, ["Upper Arm", "Elbow", "Elbow_end"]);
    assert_eq!(motion.rate, 25.0);
    let skeleton = motion.skeleton.clone().unwrap();
    assert_eq!(skeleton.rest, [DVec3::Z * 5.0, DVec3::new(2.0, 0.0, 5.0), DVec3::new(3.0, 0.0, 5.0)]);
    assert_eq!(skeleton.segments[1], Segment { from: 1, to: 2, follows: 1 });
    // Rotation about z by 90 degrees takes x to y; then about x by 90 degrees, which takes y to z.
    for (frame, joint, expected) in [
        (0, 2, [3.0, 0.0, 5.0]),
        (1, 0, [1.0, 2.0, 8.0]),
        (1, 1, [1.0, 4.0, 8.0]),
        (1, 2, [1.0, 5.0, 8.0]),
        (2, 1, [2.0, 0.0, 5.0]),
        (2, 2, [2.0, 0.0, 5.0 + FRAC_1_SQRT_2]),
    ] {
        let p = motion.frames[frame][joint].unwrap();
        // Last case: Rx(90) Rz(90) Ry(45) x = Rx Rz (c, 0, -s) = Rx (0, c, -s) = (0, s, c).
        let expected = if (frame, joint) == (2, 2) { [2.0, FRAC_1_SQRT_2, 5.0 + FRAC_1_SQRT_2] } else { expected };
        assert!(close(p, expected), "frame {frame} joint {joint}: {p}");
    }
    // A point beside the forearm shows the turn about it, which both ends of it do not.
    let side = motion.attach("side", 1, DVec3::Y).unwrap();
    assert!(close(motion.frames[1][side].unwrap(), [0.0, 4.0, 8.0]));
    assert!(motion.attach("side", 1, DVec3::Y).is_err() && motion.attach("x", 3, DVec3::Y).is_err());
    let part = motion.part(1, 9, 2).unwrap();
    assert_eq!((part.frames.len(), part.rate, part.skeleton.unwrap().rotations.len()), (1, 12.5, 1));
    assert!(motion.part(3, 9, 1).is_err());
}

#[test]
fn bvh_faults_are_named() {
    for (text, expected) in [
        (
            BVH.replace("1 2 3 90 0 0 0 0 0\n0 0 0 0 90 0 90 0 45\n", "").replace("0 0 0 0 0 0 0 0 0\n", "1 2"),
            "frame 0 of 3: the file ends",
        ),
        (BVH.replace("1 2 3 90", "1 2 x 90"), "line 20: frame 1 of 3: \"x\""),
        (BVH.replace("Frames: 3", "Frames: 99999999999"), "positions"),
        (BVH.replace("Frames: 3", "Frames: -3"), "\"-3\" frames"),
        (BVH.replace("Yrotation\n  End", "Wrotation\n  End"), "line 9: \"Wrotation\" is not a channel"),
        (BVH.replace("CHANNELS 3", "CHANNELS 1e9"), "channels"),
        (BVH.replace("OFFSET 2 0 0", "OFFSET 2 nan 0"), "line 8"),
        (BVH.replace("JOINT", "BONE"), "\"BONE\" is not expected"),
        (BVH.replace("Frame Time: 0.04", "Frame Time: soon"), "line 18"),
    ] {
        let message = bvh::parse(&text, Path::new("a.bvh")).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let more = bvh::parse(&format!("{BVH} 1 2 3"), Path::new("a.bvh")).unwrap();
    assert!(more.warnings[0].contains("left out"));
    // Position channels of other joints hold the whole offset.
    let moved = BVH
        .replace("CHANNELS 3 Zrotation Xrotation", "CHANNELS 3 Xposition Xrotation")
        .replace(" 90 0 45\n", " 4 0 0\n");
    let motion = bvh::parse(&moved, Path::new("a.bvh")).unwrap();
    assert!(close(motion.skeleton.unwrap().rest[1], [2.0, 0.0, 5.0]));
    assert!(close(motion.frames[2][1].unwrap(), [4.0, 0.0, 5.0]));
}

pub(in crate::io) const ASF: &str = ":version 1.10\n:name test\n:units\n  mass 1.0\n  length 1\n  angle deg\n:root\n order TX TY TZ RX RY RZ\n axis XYZ\n position 0 0 0\n \
    orientation 0 0 0\n:bonedata\n begin\n  id 1\n  name lower\n  direction 1 0 0\n  length 1\n  axis 0 0 90 XYZ\n  dof ry\n  limits (-1 1)\n end\n \
    begin\n  id 2\n  name upper # a comment\n  direction 2 0 0\n  length 2\n  axis 0 0 0 XYZ\n  dof rx ry rz\n  limits (-1 1)\n         (-1 1)\n end\n \
    begin\n  id 3\n  name stiff\n  direction 0 1 0\n  length 1\n  axis 0 0 0 XYZ\n end\n:hierarchy\n begin\n  upper lower\n  root upper stiff\n end\n";
pub(in crate::io) const AMC: &str = "# made by hand\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\nupper 0 0 0\nlower 0\n2\nroot 1 2 3 0 0 90\nupper 90 0 90\nlower 90\n";

#[test]
fn acclaim_moves_as_computed_by_hand() {
    let read = |asf: &str, amc: &str| {
        acclaim_skeleton::parse(asf, Path::new("a.asf"))
            .and_then(|bones| acclaim::parse(amc, Path::new("a.amc"), bones))
    };
    let motion = read(ASF, AMC).unwrap();
    let at = |f: usize, name: &str| motion.frames[f][motion.index_of(name).unwrap()].unwrap();
    assert!(close(at(0, "upper"), [2.0, 0.0, 0.0]) && close(at(0, "lower"), [3.0, 0.0, 0.0]));
    // The root turns x to y. Rz(90) Rx(90) of the upper bone leaves its direction x at y, so that
    // it points to -x.
    assert!(close(at(1, "root"), [1.0, 2.0, 3.0]) && close(at(1, "stiff"), [0.0, 2.0, 3.0]));
    assert!(close(at(1, "upper"), [-1.0, 2.0, 3.0]), "{}", at(1, "upper"));
    // The lower bone turns by 90 degrees about its own y axis, which is -x of the rest pose: x
    // stays x there, so that it goes straight on.
    assert!(close(at(1, "lower"), [-2.0, 2.0, 3.0]), "{}", at(1, "lower"));
    let skeleton = motion.skeleton.as_ref().unwrap();
    let follows = |name| skeleton.segments.iter().find(|s| s.to == motion.index_of(name).unwrap()).unwrap().follows;
    assert_eq!(follows("lower"), motion.index_of("lower").unwrap());
    assert!(motion.warnings[0].contains("120"));
    let radians = read(ASF, &AMC.replace("DEGREES", "RADIANS").replace("90", "1.5707963267948966")).unwrap();
    assert!(radians.frames[1].iter().zip(&motion.frames[1]).all(|(a, b)| a.unwrap().distance(b.unwrap()) < 1e-9));

    for (asf, amc, expected) in [
        (ASF.to_owned(), AMC.replace("lower 90\n", ""), "line 8: frame 1 gives 2 of 3"),
        (ASF.to_owned(), AMC.replace("lower 90", "lower"), "line 11: bone lower needs 1"),
        (ASF.to_owned(), AMC.replace("lower 90", "lower 90 1"), "more numbers"),
        (ASF.to_owned(), AMC.replace("lower 90", "tail 90"), "\"tail\" is no bone"),
        (ASF.to_owned(), AMC.replace("lower 90", "upper 1 2 3"), "twice in frame 1"),
        (ASF.to_owned(), String::new(), "no frames"),
        (ASF.replace("upper lower", "upper tail"), AMC.to_owned(), "\"tail\" is not defined"),
        (ASF.replace("upper stiff", "upper stiff lower"), AMC.to_owned(), "hangs below two"),
        (ASF.replace("  upper lower\n", ""), AMC.to_owned(), "\"lower\" does not hang below the root"),
        (ASF.replace("dof ry", "dof ru"), AMC.to_owned(), "line 19: \"ru\""),
        (ASF.replace("length 2", "length two"), AMC.to_owned(), "\"two\" is not a number"),
    ] {
        let message = read(&asf, &amc).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn files_are_known_by_content_and_name() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| -> PathBuf {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        dir.path().join(name)
    };
    assert_eq!(read_motion(file("a.txt", BVH.as_bytes())).unwrap().frames.len(), 3);
    assert_eq!(read_motion(file("a.dat", &c3d(86, true))).unwrap().point_count(), 3);
    assert_eq!(read_motion(file("b.csv", TRC.as_bytes())).unwrap().point_count(), 2);
    file("s.asf", ASF.as_bytes());
    let clip = file("s_01.amc", AMC.as_bytes());
    assert_eq!(read_motion(&clip).unwrap().frames.len(), 2);
    let other = file("t.asf", ASF.as_bytes());
    assert_eq!(read_motion(format!("{},{}", other.display(), clip.display())).unwrap().frames.len(), 2);
    let lost = file("u_01.amc", AMC.as_bytes());
    assert!(read_motion(lost).unwrap_err().to_string().contains("SKELETON.asf,CLIP.amc"));
    assert!(read_motion(other).unwrap_err().to_string().contains("without motion"));
    assert!(read_motion(file("x.jpg", b"abc")).unwrap_err().to_string().contains("known kind"));
    assert!(read_motion(file("y", b"")).unwrap_err().to_string().contains("empty"));
    assert!(read_motion(dir.path().join("gone.c3d")).is_err() && read_motion(dir.path()).is_err());
}

#[test]
fn markers_are_found_with_and_without_their_subject() {
    let text = TRC.replace("LKNE", "Anna:LKNE").replace("RKNE", "Anna:RKNE");
    let mut motion = trc::parse(&text, Path::new("a.trc")).unwrap();
    assert_eq!((motion.index_of("Anna:LKNE").unwrap(), motion.index_of("rkne").unwrap()), (0, 1));
    let message = motion.index_of("HEAD").unwrap_err().to_string();
    assert!(message.contains("HEAD") && message.contains("Anna:LKNE"), "{message}");
    motion.names = vec!["a:X".into(), "b:X".into()];
    assert!(motion.index_of("X").unwrap_err().to_string().contains("may be"));
    let twice = trc::parse(&TRC.replace("RKNE", "LKNE"), Path::new("a.trc")).unwrap();
    assert_eq!(twice.names, ["LKNE", "LKNE (1)"]);
    assert!(twice.warnings[0].contains("more than once"));
}

/// The shared clips: their sizes, that bones keep their lengths, and that people are as large and
/// fast as people.
#[test]
#[ignore = "needs BARYMAP_DATA"]
fn the_shared_clips_are_plausible() {
    let folder = PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA")).join("mocap");
    for (name, frames, points, rate, metres) in [
        ("cmu_01_01.bvh", 2752, 38, 120.0, None),
        ("cmu_11_01.amc", 597, 31, 120.0, None),
        ("mh_walk1.bvh", 14, 91, 24.0, None),
        ("movement_trial.c3d", 323, 159, 120.0, Some(0.001)),
        ("qualisys_walk.c3d", 340, 55, 200.0, Some(0.001)),
        ("robo_static.c3d", 560, 111, 240.0, Some(0.001)),
    ] {
        let motion = read_motion(folder.join(name)).unwrap();
        let valid = motion.frames.iter().flatten().flatten().count() as f64;
        let share = valid / (motion.frames.len() * motion.point_count()) as f64;
        println!(
            "{name}: {} frames, {} points, {share:.3} valid; {:?}",
            motion.frames.len(),
            motion.point_count(),
            motion.warnings
        );
        assert!(points == 0 || motion.point_count() == points, "{name}: {}", motion.point_count());
        assert!(frames == 0 || motion.frames.len() == frames, "{name}: {}", motion.frames.len());
        assert!((motion.rate - rate).abs() < 0.01 && motion.metres_per_unit == metres, "{name}: {}", motion.rate);
        if let Some(skeleton) = &motion.skeleton {
            for segment in &skeleton.segments {
                let rest = skeleton.rest[segment.from].distance(skeleton.rest[segment.to]);
                for frame in &motion.frames {
                    let length = frame[segment.from].unwrap().distance(frame[segment.to].unwrap());
                    assert!((length - rest).abs() < 1e-9 * (1.0 + rest), "{name}: {segment:?}: {length} for {rest}");
                }
            }
        } else {
            let all = || motion.frames.iter().flatten().flatten();
            let low = all().copied().reduce(DVec3::min).unwrap();
            let high = all().copied().reduce(DVec3::max).unwrap();
            println!("{name}: {low} to {high}");
            assert!((1200.0..2700.0).contains(&(high.z - low.z)), "{name}: {}", high.z - low.z);
        }
    }
}
