//! `--memory` bounds the whole process, or the work is refused with the number.

use barymap::io::write_image;
use barymap::models::shapes::uv_sphere;
use barymap::picture::{Image, Pixels};

use crate::support::{Folder, Ran};

const MIB: u64 = 1 << 20;

/// Limits as they are given, and in MiB.
const LIMITS: [(&str, u64); 4] = [("250M", 250), ("500M", 500), ("1G", 1024), ("4G", 4096)];

/// What is wrong with a run under a limit of so many MiB: nothing where the process took at most
/// 1.1 times the limit and what the program takes itself, and ended well or was refused with the
/// number.
fn fault(ran: &Ran, limit: u64, on_device: bool) -> Option<String> {
    let program = if on_device { 400 } else { 100 };
    let bound = limit * MIB * 11 / 10 + program * MIB;
    let Some(peak) = ran.peak_memory else { return Some("the system does not tell the peak".into()) };
    if peak > bound {
        return Some(format!("{} MiB, {} are the bound: {}", peak / MIB, bound / MIB, ran.stderr));
    }
    match ran.code {
        Some(0) => None,
        Some(1) if ran.message().contains(&format!("{} are allowed", limit * MIB)) => None,
        code => Some(format!("{code:?}: {}", ran.stderr)),
    }
}

/// Runs a command under each limit. At the largest it must succeed, or nothing would be shown.
#[track_caller]
fn check(f: &Folder, command: &str, on_device: bool) {
    let mut told = Vec::new();
    for (text, limit) in LIMITS {
        let ran = f.run(&format!("{command} --no-cache --memory {text}"));
        let fault = fault(&ran, limit, on_device);
        told.push(format!("{text}: {} MiB, {:?}", ran.peak_memory.unwrap_or(0) / MIB, ran.code));
        assert!(fault.is_none(), "{command}: {text}: {fault:?}");
        assert!(limit < 4096 || ran.code == Some(0), "{command}: {told:?} {}", ran.stderr);
    }
    println!("{command}: {}", told.join("; "));
}

/// A picture of noise, which no codec makes small.
fn noise(width: u32, height: u32) -> Image {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    Image::new(width, height, 3, Pixels::U8((0..width * height * 3).map(|_| next()).collect())).unwrap()
}

const TRANSFER: &str =
    "transfer --source out/source.obj --target out/target.obj --anchors out/pairs.json -o skin.png --model m.glb";

#[test]
#[cfg(target_os = "linux")]
fn a_transfer_stays_within_the_limit() {
    let f = Folder::empty();
    f.run("demo --size 256 --backend cpu").succeeds();
    check(&f, &format!("{TRANSFER} --backend cpu --size 4096"), false);
}

#[test]
#[cfg(target_os = "linux")]
fn a_transfer_on_a_device_stays_within_the_limit() {
    if barymap::engine::Engine::adapters().is_empty() {
        assert!(std::env::var_os("BARYMAP_REQUIRE_GPU").is_none(), "there is no adapter");
        println!("not run: there is no adapter");
        return;
    }
    let f = Folder::empty();
    f.run("demo --size 256 --backend cpu").succeeds();
    check(&f, &format!("{TRANSFER} --backend gpu --size 2048"), true);
}

#[test]
#[cfg(target_os = "linux")]
fn an_embedding_stays_within_the_limit() {
    let f = Folder::empty();
    barymap::io::write_obj(&uv_sphere(1.0, 400, 190), f.path("s.obj")).unwrap();
    check(&f, "embed s.obj -o e.npy", false);
}

#[test]
#[cfg(target_os = "linux")]
fn a_warp_stays_within_the_limit() {
    let f = Folder::empty();
    write_image(&noise(4000, 3000), f.path("big.bmp")).unwrap();
    f.write(
        "cage.json",
        r#"{"units": "unit", "source": [[0, 0], [1.3, 0], [1.3, 1], [0, 1]], "target": [[0, 0], [1.2, 0.1], [1.3, 0.9], [0.1, 1]]}"#,
    );
    check(&f, "warp big.bmp --cage cage.json -o w.png --backend cpu", false);
}

#[test]
#[cfg(target_os = "linux")]
fn pictures_that_do_not_fit_are_refused_before_they_are_decoded() {
    let f = Folder::spheres();
    // Black: 288 MB in a file of less than one.
    write_image(&Image::zeros(12_000, 8000, 3, barymap::picture::Depth::U8).unwrap(), f.path("black.png")).unwrap();
    f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
    for command in [
        "warp black.png --cage cage.json -o o.png",
        "transfer --source s.obj --target t.obj --texture black.png --anchors a.json -o o.png",
    ] {
        let ran = f.run(&format!("{command} --backend cpu --memory 500M"));
        ran.fails_like(1, &["black.png", "12000 x 8000", "524288000 are allowed", "--memory"]);
        assert!(ran.peak_memory.is_none_or(|peak| peak < 100 * MIB), "{:?}", ran.peak_memory);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn very_many_pairs_are_refused_under_the_default_limit() {
    let f = Folder::spheres();
    f.anchors("many.json", 20_000, |p| p);
    for command in [
        "map --source s.obj --target t.obj --anchors many.json --method rbf -o m.csv",
        "map --source s.obj --target t.obj --anchors many.json --method field -o m.csv",
    ] {
        let ran = f.run(&format!("{command} --backend cpu --no-cache"));
        let fault = fault(&ran, 4096, false);
        assert!(fault.is_none() && ran.code == Some(1), "{command}: {:?} {fault:?} {}", ran.code, ran.stderr);
    }
}

/// The chunks of a PNG file with this name, joined.
fn chunks(png: &[u8], name: &[u8; 4]) -> Vec<u8> {
    let (mut found, mut at) = (Vec::new(), 8);
    while at < png.len() {
        let length = u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
        if png[at + 4..at + 8] == *name {
            found.extend_from_slice(&png[at + 8..at + 8 + length]);
        }
        at += 12 + length;
    }
    found
}

#[test]
#[cfg(target_os = "linux")]
fn a_profile_that_unpacks_to_very_much_is_passed_over() {
    let f = Folder::spheres();
    // The packed pixels of a black picture are a profile of 256 MB.
    write_image(&Image::zeros(16_000, 16_000, 1, barymap::picture::Depth::U8).unwrap(), f.path("black.png")).unwrap();
    let packed = chunks(&f.bytes("black.png"), b"IDAT");
    let mut chunk = [b"iCCPbomb\0\0", packed.as_slice()].concat();
    let (length, checksum) = ((chunk.len() - 4) as u32, crc32fast::hash(&chunk));
    chunk.splice(0..0, length.to_be_bytes());
    chunk.extend_from_slice(&checksum.to_be_bytes());
    let mut png = f.bytes("s.png");
    png.splice(33..33, chunk);
    std::fs::write(f.path("bomb.png"), png).unwrap();
    f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
    let ran = f.run("warp bomb.png --cage cage.json -o o.png --backend cpu --memory 250M").succeeds();
    assert!(ran.stderr.contains("its colour profile is damaged, or far too large"), "{}", ran.stderr);
    assert!(ran.peak_memory.is_some_and(|peak| peak < 150 * MIB), "{:?}", ran.peak_memory);
}
