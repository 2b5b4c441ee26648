//! Names and lines of OBJ and MTL files as other programs write them.

use super::*;

#[test]
fn lines_end_in_any_way_and_comments_with_their_line() {
    let f = with_materials(b"newmtl m\nmap_Kd t.png\n", "m");
    let text = f.read("source.obj");
    for (name, text) in [
        ("cr.obj", text.replace('\n', "\r")),
        ("crlf.obj", text.replace('\n', "\r\n")),
        ("mixed.obj", text.replacen('\n', "\r", 40).replacen("\nf", "\r\nf", 9)),
        (
            "comment.obj",
            text.replacen("f ", "# C:\\scans\\\nf ", 1).replacen("\nusemtl m\nf", "\n# D:\\\r\nusemtl m\nf", 1),
        ),
        ("continued.obj", text.replace("f 1/1 ", "f 1/1 \\ \t\n")),
    ] {
        f.write(name, &text);
        let ran = shows(&f, name, "", texel(0));
        assert!(!ran.stderr.contains("no colour"), "{name}: {}", ran.stderr);
    }
    // The material library, too.
    f.write("m.mtl", "newmtl m\rmap_Kd t.png\r");
    shows(&f, "source.obj", "", texel(0));
}

#[test]
fn names_are_bytes() {
    for (one, two) in [(&b"Haut_\xe4"[..], &b"Haut_\xf6"[..]), (b"\x95\x5c", b"\x83\x5c"), ("ä".as_bytes(), b"\xe4")] {
        let f = folder();
        let mtl = [b"newmtl ", one, b"\nmap_Kd t.png\nnewmtl ", two, b"\nmap_Kd t2.png\n"].concat();
        std::fs::write(f.path("m.mtl"), mtl).unwrap();
        let text = plane("usemtl TWO\n", both);
        let (below, above) = text.split_once("TWO").unwrap();
        let obj = [b"mtllib m.mtl\nusemtl ", one, b"\n", below.as_bytes(), two, above.as_bytes()].concat();
        std::fs::write(f.path("source.obj"), obj).unwrap();
        let ran = shows(&f, "source.obj", "", |x, y| texel(if y < SIZE / 2 { 200 } else { 0 })(x, y));
        assert!(!ran.stderr.contains("not defined"), "{}", ran.stderr);
    }
}

#[test]
fn names_of_pictures_are_read_as_they_are_written_anywhere() {
    for (statement, file, note) in [
        ("map_Kd \"my tex.png\"", "my tex.png", None),
        ("map_Kd t.png -s 1 1 1", "t.png", None),
        ("map_Kd t.png # the skin", "t.png", None),
        ("map_Kd C:\\Users\\someone\\Desktop\\t.png", "t.png", Some("t.png is taken")),
        ("map_Kd /home/someone/maps/T.PNG", "maps/t.png", Some("maps/t.png is taken")),
        ("\tmap_Kd\t-bm 1 skin#1 b.png", "skin#1 b.png", None),
    ] {
        let f = with_materials(format!("newmtl m\n{statement}\n").as_bytes(), "m");
        if file != "t.png" {
            std::fs::create_dir_all(f.path(file).parent().unwrap()).unwrap();
            std::fs::rename(f.path("t.png"), f.path(file)).unwrap();
        }
        let ran = shows(&f, "source.obj", "", texel(0));
        match note {
            Some(note) => assert!(ran.stderr.contains(note), "{statement}: {}", ran.stderr),
            None => assert!(!ran.stderr.contains("texture"), "{statement}: {}", ran.stderr),
        }
    }
}

#[test]
fn libraries_are_found_wherever_they_are_named() {
    let mtl = b"newmtl m\nmap_Kd t.png\n";
    let f = with_materials(mtl, "m");
    std::fs::write(f.path("other.mtl"), "newmtl m\nmap_Kd t2.png\nnewmtl x\n").unwrap();
    std::fs::write(f.path("my lib.mtl"), mtl).unwrap();
    let faces = plane("", both);
    for head in [
        "usemtl m\nFACES\nmtllib m.mtl",
        "mtllib gone.mtl m.mtl\nusemtl m # skin\nFACES",
        "mtllib my lib.mtl other.mtl\nusemtl m\nFACES",
        "mtllib \"my lib.mtl\"\nusemtl \"m\"\nFACES",
        "mtllib C:\\art\\M.MTL\nusemtl m\nFACES",
        // Two files joined: each part has the library before it.
        "mtllib other.mtl\nusemtl x\nf 1 1 1\nmtllib m.mtl\nusemtl m\nFACES",
    ] {
        f.write("source.obj", &head.replace("FACES", &faces).replacen("f 1 1 1\n", "", 1));
        let ran = shows(&f, "source.obj", "", texel(0));
        assert_eq!(ran.stderr.contains("gone.mtl"), head.contains("gone"), "{}", ran.stderr);
    }
}
