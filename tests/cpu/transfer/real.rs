//! Transfers of real models onto themselves.

use barymap::io::{read_image, read_mesh};
use barymap::picture::{Image, Pixels};
use barymap::tools::transfer::{Background, TransferOptions, coverage};

use super::atlas::{rasterize, whole};
use super::whole::{Identity, bytes, options, run};

/// Every texel whose centre lies in a chart comes back bit for bit, on models made by artists.
#[test]
#[ignore = "needs BARYMAP_DATA"]
fn real_models_reproduce_their_textures() {
    let data = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the test data"));
    for (folder, model, texture) in [
        ("human_female", "human_female.obj", "mh_texture.png"),
        ("fox", "fox.obj", "fox_texture.png"),
        ("spot", "spot.obj", "spot_texture.png"),
        ("blub", "blub.obj", "blub_texture.png"),
        ("knight", "knight.obj", "knight_texture.png"),
    ] {
        let folder = data.join("textured").join(folder);
        let mesh = read_mesh(folder.join(model)).expect("model").mesh;
        let image = read_image(folder.join(texture)).expect("texture");
        let (w, h, n) = (image.width, image.height, image.channels as usize);
        let out = run(
            &mesh,
            &image,
            &mesh,
            &Identity,
            &TransferOptions { background: Background::Color([0.0; 4]), ..options(w, h) },
        );
        let texels = rasterize(&mesh, w, h, whole(w, h));
        let (a, b) = (bytes(&image), bytes(&out.layers[0]));
        let mut centres = 0;
        let mut wrong = Vec::new();
        for (i, _) in texels.iter().enumerate().filter(|(_, t)| t.is_centre()) {
            centres += 1;
            assert_eq!(bytes(&out.coverage)[i], coverage::VALID);
            let off = (i * n..i * n + n).map(|k| a[k].abs_diff(b[k])).max();
            if off > Some(0) {
                wrong.push((i as u32 % w, i as u32 / w, off));
            }
        }
        println!("  {} of {centres} differ: {:?}", wrong.len(), &wrong[..wrong.len().min(8)]);
        assert!(centres > w * h / 20 && wrong.is_empty());
        if let Some(folder) = std::env::var_os("BARYMAP_PICTURES") {
            let folder = std::path::PathBuf::from(folder);
            let save = |image: &Image, name: &str| {
                barymap::io::write_image(image, folder.join(format!("{model}{name}.png"))).expect("picture");
            };
            save(&out.layers[0], "");
            save(&out.coverage, ".coverage");
            assert!(matches!(out.coverage.pixels, Pixels::U8(_)));
        }
    }
}
