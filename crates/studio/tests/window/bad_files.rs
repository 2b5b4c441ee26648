//! Files that are broken, dropped onto the window: words, and the window stays.

use std::path::{Path, PathBuf};

use barymap_studio::view::Weight;

use crate::support::{Window, built_in};

/// Drops a file and waits until it was read or refused; whether it was refused, and in which words.
fn dropped(window: &mut Window, path: &Path) -> Option<String> {
    let before = window.studio().messages().total();
    window.drop_file(path);
    window.until(&format!("an end of {}", path.display()), |s| s.is_at_rest());
    let told = (window.studio().messages().total() - before) as usize;
    let list: Vec<_> = window.studio().messages().list().cloned().collect();
    let failed = list.iter().rev().take(told).find(|m| m.0 == Weight::Failed);
    failed.map(|m| m.1.clone())
}

#[test]
fn broken_files_are_told_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let (_, files) = built_in(folder.path());
    let mut window = Window::new(&[]);
    let write = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let whole = std::fs::read(&files[0]).unwrap();
    let picture = std::fs::read(folder.path().join("skin.png")).unwrap();
    let bad = [
        write("empty.obj", b""),
        write("noise.glb", &[0x5a; 4096]),
        write("words.ply", b"ply\nformat ascii 1.0\nelement vertex many\n"),
        write("faces.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 99\n"),
        write("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        write("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        write("noise.json", b"{\"source\": ["),
        write("project.json", b"{\"format\": \"barymap-studio\", \"version\": 7000}"),
        write("unknown.xyzzy", b"what is this"),
        folder.path().join("none.obj"),
        folder.path().to_path_buf(),
    ];
    for path in &bad {
        let words = dropped(&mut window, path).unwrap_or_else(|| panic!("{} was not refused", path.display()));
        assert!(words.len() > 20, "{}: {words}", path.display());
    }
    assert!(window.studio().document().transfer.files.iter().all(Option::is_none));
    // Whole ones after all of these; half a picture and half a mesh leave them as they are.
    for file in &files {
        assert_eq!(dropped(&mut window, file), None);
    }
    let document = window.studio().document().clone();
    assert!(
        dropped(&mut window, &write("half.obj", &whole[..whole.len() / 3])).is_some() || {
            // A third of an OBJ file has vertices and no faces.
            false
        }
    );
    assert_eq!(*window.studio().document(), document);
    assert!(dropped(&mut window, &write("half.png", &picture[..picture.len() / 2])).is_some());
}

#[test]
#[ignore = "needs the folder that BARYMAP_DATA names"]
fn the_collection_of_broken_files_is_told_in_words() {
    let data = PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names a folder"));
    let mut files = Vec::new();
    for folder in [data.join("bad"), data.join("../cases")] {
        collect(&folder, &mut files);
    }
    files.sort();
    assert!(files.len() >= 20, "only {} files", files.len());
    let mut window = Window::new(&[]);
    let mut refused = 0;
    for path in &files {
        let words = dropped(&mut window, path);
        refused += usize::from(words.is_some());
        println!("{}: {}", path.display(), words.as_deref().unwrap_or("taken"));
    }
    println!("{} files, {refused} refused", files.len());
    assert!(refused > 0);
}

/// Files of a folder and of those in it that are small enough to be read in a test.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        match entry.metadata() {
            Ok(m) if m.is_dir() => collect(&path, files),
            Ok(m) if m.len() < 4 << 20 => files.push(path),
            _ => (),
        }
    }
}
