//! Clips as other programs write them: the same motion.

use std::path::Path;

use glam::DVec3;

use super::tests::{AMC, ASF, BVH, TRC};
use super::*;

/// The arm as other programs write it: nothing of that changes what moves.
#[test]
fn bvh_is_read_as_programs_write_it() {
    let plain = bvh::parse(BVH, Path::new("a.bvh")).unwrap();
    let dense: String = BVH
        .replace("\n {\n", "{")
        .replace("\n{\n", "{")
        .replace("\n  {\n", "{")
        .replace("\n  }", "}")
        .replace("{ ", "{");
    assert!(dense.contains("Arm{OFFSET") && dense.contains("Site{  OFFSET"), "{dense}");
    for text in [
        dense,
        BVH.replace('\n', "\r"),
        BVH.replace('\n', "\r\n"),
        BVH.replace("End Site", "End site"),
        BVH.replace("End Site", "END SITE"),
        BVH.replace("End Site", "End"),
        BVH.replace("End Site", "EndSite"),
        BVH.replace("End Site", "End Site hand tip"),
        BVH.replace("Frames: 3", "Frames:3").replace("Frame Time: 0.04", "Frame Time:0.04"),
        BVH.replace("Frames: 3", "FRAMES : 3").replace("Frame Time: 0.04", "FrameTime: 0.04"),
        BVH.replace("Frames: 3", "Frames 3").replace("Frame Time: 0.04", "frame time 0.04"),
        BVH.replace("0.04", "0,04"),
        BVH.replace("MOTION", "Motion").replace("HIERARCHY", "Hierarchy").replace("OFFSET", "Offset"),
    ] {
        let read = bvh::parse(&text, Path::new("a.bvh")).unwrap();
        assert_eq!((&read.names, read.rate, &read.frames), (&plain.names, plain.rate, &plain.frames), "{text}");
        assert_eq!(read.warnings, [""; 0], "{text}");
    }
    let untimed = bvh::parse(&BVH.replace("Frame Time: 0.04\n", ""), Path::new("a.bvh")).unwrap();
    assert_eq!((untimed.rate, untimed.frames), (30.0, plain.frames.clone()));
    assert!(untimed.warnings[0].contains("no usable rate"));
    // Files that end before their last frame: what is there moves.
    for (declared, cut, words) in [
        ("Frames: 4", "", "4 frames are declared, the file holds 3: those 3 are read"),
        ("Frames: 3", " 45\n", "holds 2 and 8 of 9 numbers of another"),
    ] {
        let text = BVH.replace("Frames: 3", declared);
        let text = text.strip_suffix(cut).unwrap();
        let read = bvh::parse(text, Path::new("a.bvh")).unwrap();
        assert_eq!(read.frames, plain.frames[..read.frames.len()]);
        assert_eq!(read.skeleton.unwrap().rotations.len(), read.frames.len());
        assert!(read.warnings[0].contains(words), "{:?}", read.warnings);
    }
}

#[test]
fn bvh_scales_are_passed_over() {
    let plain = bvh::parse(BVH, Path::new("a.bvh")).unwrap();
    let (head, rows) = BVH.split_once("0 0 0 0 0 0 0 0 0\n").unwrap();
    assert_eq!(rows, "1 2 3 90 0 0 0 0 0\n0 0 0 0 90 0 90 0 45\n");
    let head = head.replace("CHANNELS 6 ", "CHANNELS 9 Xscale YSCALE zScale ");
    let scaled = |factor: &str| {
        let rows = format!("1 1 1 0 0 0 0 0 0 0 0 0\n1 {factor} 1 1 2 3 90 0 0 0 0 0\n1 1 1 0 0 0 0 90 0 90 0 45\n");
        bvh::parse(&(head.clone() + &rows), Path::new("a.bvh")).unwrap()
    };
    assert_eq!((scaled("1").frames, scaled("1").warnings.len()), (plain.frames.clone(), 0));
    assert_eq!(scaled("2").frames, plain.frames);
    assert!(
        scaled("2").warnings[0].contains("scales other than 1, which are not used: 1, first on line 20"),
        "{:?}",
        scaled("2").warnings
    );
}

#[test]
fn names_in_other_encodings_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: Vec<u8>| {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        read_motion(dir.path().join(name)).unwrap()
    };
    let (latin, japanese) = (encoding_rs::WINDOWS_1252, encoding_rs::SHIFT_JIS);
    let elbow = |encoding: &'static encoding_rs::Encoding, name: &str| {
        encoding.encode(&BVH.replace("Elbow", name)).0.into_owned()
    };
    for (motion, name) in [
        (read("l.bvh", elbow(latin, "Rücken")), "Rücken"),
        (read("j.bvh", elbow(japanese, "左ひじ")), "左ひじ"),
        (read("u.bvh", BVH.replace("Elbow", "左ひじ").into_bytes()), "左ひじ"),
        (read("l.trc", latin.encode(&TRC.replace("LKNE", "Füße")).0.into_owned()), "Füße"),
        (read("l.csv", latin.encode("time;Füße.x;Füße.y;Füße.z\n0,5;1;2;3,5\n0,75;1;2;3,5\n").0.into_owned()), "Füße"),
    ] {
        let place = motion.index_of(name).unwrap();
        assert!(motion.frames[0][place].is_some());
        let noted = motion.warnings.iter().any(|w| w.contains("not UTF-8"));
        assert_eq!(noted, !motion.path.ends_with("u.bvh"), "{:?}", motion.warnings);
    }
    std::fs::write(dir.path().join("s.asf"), latin.encode(&ASF.replace("stiff", "rücken")).0).unwrap();
    let clip = read("s_01.amc", AMC.replace('\n', "\r").into_bytes());
    assert!(clip.index_of("rücken").is_ok() && clip.frames.len() == 2);
}

#[test]
fn csv_is_read_in_the_dialects_of_spreadsheets() {
    let plain = csv::parse("time,L.x,L.y,L.z\n0,1,2,3.5\n0.25,7,8,9\n", Path::new("a.csv")).unwrap();
    for text in [
        "Time;L X;L Y;L Z\r\n0;1;2;3,5\r\n0,25;7;8;9\r\n",
        "L.z\tL.y\tL.x\ttime\n3.5\t2\t1\t0\n9\t8\t7\t0.25\n",
        "\"time\",\"L.x\",\"L.y\",\"L.z\"\n\"0\",\"1\",\"2\",\"3,5\"\n\"0,25\",\"7\",\"8\",\"9\"\n",
    ] {
        let motion = csv::parse(text, Path::new("a.csv")).unwrap();
        assert_eq!((&motion.names, motion.rate, &motion.frames), (&plain.names, plain.rate, &plain.frames), "{text}");
    }
    let mixed = csv::parse("time;L.x;L.y;L.z\n0;1,5;2;3\n1;1.5;2;3\n", Path::new("a.csv")).unwrap_err().to_string();
    assert!(mixed.contains("line 3") && mixed.contains("decimal point"), "{mixed}");
}

/// A take of Motive: a rigid body that turns, a marker that the body predicts, and two that are
/// measured.
const MOTIVE: &str = "Format Version,1.23,Take Name,walk,Take Notes,,Capture Frame Rate,240.000000,Export Frame Rate,120.000000,\
    Total Exported Frames,3,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global\n\n\
    ,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Marker,Marker,Marker,Marker,Marker,Marker\n\
    ,Name,\"Head, upper\",\"Head, upper\",\"Head, upper\",\"Head, upper\",\"Head, upper\",\"Head, upper\",\"Head, upper\",\"Head, upper\",Head:M1,Head:M1,Head:M1,Head:M1,Head:M1,Head:M1,Head:M1,LKNE,LKNE,LKNE\n\
    ,ID,1,1,1,1,1,1,1,1,2,2,2,2,3,3,3,4,4,4\n\
    ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position,Marker Quality,Position,Position,Position,Position,Position,Position\n\
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,,X,Y,Z,X,Y,Z\n\
    10,0.083333,0,0,0,1,1,2,3,0.1,4,5,6,1,7,8,9,10,11,12\n\
    11,0.091667,0,0,0.7,0.7,1.5,2,3,0.1,4,5,6,1,,,,10,11,12.5\n\
    13,0.108333,0,0,0,1,2,2,3,0.1,4,5,6,1,7,8,9,,,\n";

#[test]
fn takes_of_motive_are_read() {
    let check = |text: &str, rate: f64| {
        let motion = csv::parse(text, Path::new("walk.csv")).unwrap();
        assert_eq!(motion.names, ["Head, upper", "Head:M1", "Head:M1 (Marker)", "LKNE"]);
        assert_eq!((motion.rate, motion.metres_per_unit, motion.frames.len()), (rate, Some(0.001), 4));
        let p = |x: f64, y: f64, z: f64| Some(DVec3::new(x, y, z));
        assert_eq!(motion.frames[0], [p(1.0, 2.0, 3.0), p(4.0, 5.0, 6.0), p(7.0, 8.0, 9.0), p(10.0, 11.0, 12.0)]);
        assert_eq!(motion.frames[1], [p(1.5, 2.0, 3.0), p(4.0, 5.0, 6.0), None, p(10.0, 11.0, 12.5)]);
        // A frame that was dropped, and gaps.
        assert_eq!(motion.frames[2], [None; 4]);
        assert_eq!(motion.frames[3], [p(2.0, 2.0, 3.0), p(4.0, 5.0, 6.0), p(7.0, 8.0, 9.0), None]);
        assert!(motion.warnings.iter().any(|w| w.contains("rotations of 1 rigid bodies")), "{:?}", motion.warnings);
    };
    check(MOTIVE, 120.0);
    check(&MOTIVE.replace('\n', "\r\n"), 120.0);
    check(&MOTIVE.replace("Export Frame Rate,120.000000,", ""), 240.0);
    // Older versions write no words before the rows, newer ones a row more.
    check(&MOTIVE.replace(",Type,", ",,").replace(",Name,", ",,").replace(",ID,", ",,"), 120.0);
    check(&MOTIVE.replace(",ID,", ",Parent,a,a,a,a,a,a,a,a,,,,,,,,,,\n,ID,"), 120.0);
    for (text, expected) in [
        (MOTIVE.replace("Position", "Rotation"), "no columns of positions"),
        (MOTIVE.replace("Frame,Time", "Row,Time"), "no row that begins with Frame"),
        (MOTIVE.replace("12.5", "high"), "line 9: marker LKNE: \"high\""),
        (MOTIVE.replace("\n11,", "\nx,"), "line 9: \"x\" is not a frame number"),
        (MOTIVE.split("10,0.08").next().unwrap().to_owned(), "no frames"),
    ] {
        let message = csv::parse(&text, Path::new("walk.csv")).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}
