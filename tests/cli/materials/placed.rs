//! Pictures that materials move, turn, clamp or mirror.

use super::*;

#[test]
fn pictures_lie_as_mtl_options_say() {
    let half = SIZE / 2;
    // Repeated twice at the size of the result: 32 texels a repeat.
    let f = with_materials(b"newmtl m\nmap_Kd -s 2 2 1 t.png\nnewmtl n\nmap_Kd -clamp on -s 2 2 -o 0 -1 t.png\n", "m");
    write_image(&picture(half, half, 0), f.path("t.png")).unwrap();
    let of = |x: u32, y: u32| [(255 * x / half) as u8, (255 * y / half) as u8, 0];
    shows(&f, "source.obj", "", |x, y| of(x % half, y % half));
    // Another material with the same picture: its upper half, moved down by one, is clamped on the
    // right.
    let upper = with_materials(&f.bytes("m.mtl"), "n");
    write_image(&picture(half, half, 0), upper.path("t.png")).unwrap();
    shows(&upper, "source.obj", "", |x, y| if y < half { of(x.min(half - 1), y) } else { of(x % half, y % half) });
    // The ST-map tells places in the picture.
    transfer(&f, "source.obj", "-o out.png --stmap st.exr").succeeds();
    let st = f.image("st.exr");
    let at = |x: u32, y: u32| [st.get(x, y, 0), st.get(x, y, 1)].map(|c| (c * half as f32) as u32);
    assert_eq!((at(5, 7), at(40, 50)), ([5, half - 1 - 7], [40 - half, half - 1 - (50 - half)]));
    // So does a picture given by hand that takes the place of the material's.
    write_image(&picture(half, half, 77), f.path("new.png")).unwrap();
    let ran =
        shows(&f, "source.obj", "--texture new.png", |x, y| [of(x % half, y % half)[0], of(x % half, y % half)[1], 77]);
    assert!(ran.stderr.contains("lies as material"), "{}", ran.stderr);
}

#[test]
fn pictures_lie_as_samplers_and_transforms_say() {
    let f = folder();
    let half = SIZE / 2;
    write_image(&picture(half, half, 0), f.path("t.png")).unwrap();
    let of = |x: u32, y: u32| [(255 * x / half) as u8, (255 * y / half) as u8, 0];
    let images = json!([{"uri": "t.png"}, {"uri": "t2.png"}]);
    let textured = |texture: Value| json!({"pbrMetallicRoughness": {"baseColorTexture": texture}});
    // Coordinates from -0.5 to 1.5: mirrored along u, clamped along v.
    write_gltf(
        &f,
        2.0,
        -0.5,
        json!({
            "images": images, "textures": [{"source": 0, "sampler": 0}],
            "samplers": [{"wrapS": 33648, "wrapT": 33071}], "materials": [textured(json!({"index": 0}))],
        }),
        None,
    );
    let mirrored = |x: u32| match x {
        0..16 => 15 - x,
        16..48 => x - 16,
        _ => 47 + half - x,
    };
    let clamped = |y: u32| y.saturating_sub(16).min(half - 1);
    shows(&f, "source.gltf", "", |x, y| of(mirrored(x), clamped(y)));
    // A quarter turn of a picture that is not square, below; above another placement of the same
    // picture.
    write_image(&picture(SIZE, 2 * SIZE, 0), f.path("t2.png")).unwrap();
    let turned = json!({"offset": [0.0, 1.0], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 1.0]});
    let squeezed = json!({"scale": [1.0, 0.5], "offset": [0.0, 0.25]});
    let transform = |t: &Value| textured(json!({"index": 0, "extensions": {"KHR_texture_transform": t}}));
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": images, "textures": [{"source": 1}], "materials": [transform(&turned), transform(&squeezed)],
            "extensionsUsed": ["KHR_texture_transform"], "extensionsRequired": ["KHR_texture_transform"],
        }),
        None,
    );
    let tall = |x: u32, y: u32| [(255 * x / SIZE) as u8, (255 * y / (2 * SIZE)) as u8, 0];
    shows(&f, "source.gltf", "", |x, y| if y < half { tall(x, y + half) } else { tall(y, 2 * SIZE - 1 - x) });
}
