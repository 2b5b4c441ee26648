//! Public functions give an error, never a panic, for arguments that do not fit one another.

use barymap::engine::Engine;
use barymap::geometry::sampling::farthest_points;
use barymap::geometry::weld::weld;
use barymap::geometry::{Corner, Geodesics, Mesh, MeshBuilder, NONE, SurfacePoint, Topology, Weld};
use barymap::io::anchors::write_pairs;
use barymap::models::shapes::{icosphere, uv_sphere};
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions, IdentityMap, PackedPoint};
use barymap::tools::transfer::{Layer, TransferOptions, transfer_on};
use glam::{DVec2, DVec3};

/// What a test does to a mesh that is being built.
type Spoil<'a> = &'a dyn Fn(&mut MeshBuilder);

/// A triangle whose corner, colours or polygon a test spoils.
fn spoilt(spoil: impl Fn(&mut MeshBuilder)) -> barymap::Result<Mesh> {
    let mut builder = MeshBuilder::new("one");
    builder.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    builder.mesh.texcoords = vec![DVec2::ZERO];
    let corner = |vertex| Corner { vertex, texcoord: 0, normal: NONE };
    builder.polygon([corner(0), corner(1)]);
    spoil(&mut builder);
    builder.polygon([0, 1, 2].map(corner));
    builder.build()
}

#[test]
fn a_mesh_that_does_not_fit_together_is_refused_with_its_element() {
    assert_eq!(spoilt(|_| ()).unwrap().triangle_count(), 1);
    let corner = |c: &mut Corner, k: usize| match k {
        0 => c.vertex = 3,
        1 => c.texcoord = 1,
        _ => c.normal = 0,
    };
    let cases: [(Spoil<'_>, &str); 7] = [
        (&|b| corner(&mut b.corners_mut()[1], 0), "face 0, corner 1: there is no vertex 3, there are 3"),
        (&|b| corner(&mut b.corners_mut()[1], 1), "face 0, corner 1: there is no texture coordinate 1, there are 1"),
        (&|b| corner(&mut b.corners_mut()[0], 2), "face 0, corner 0: there is no normal 0, there are 0"),
        (&|b| b.material = 0, "face 1: there is no material 0, there are 0"),
        (&|b| b.group = 5, "face 1: there is no group 5, there are 0"),
        (&|b| b.object = 2, "face 1: there is no object 2, there are 0"),
        (&|b| b.mesh.colors = vec![[1.0; 4]; 2], "2 colours for 3 vertices"),
    ];
    for (spoil, expected) in cases {
        let message = spoilt(spoil).unwrap_err().to_string();
        assert!(message.starts_with("mesh one: ") && message.contains(expected), "{message}");
    }
    let message = Mesh::from_triangles("m", vec![DVec3::ZERO; 3], &[[0, 1, 2], [0, 1, 3]]).unwrap_err().to_string();
    assert!(message.contains("face 1, corner 2: there is no vertex 3"), "{message}");
}

#[test]
fn distances_of_what_does_not_exist_are_errors_or_infinite() {
    let mesh = icosphere(1.0, 1);
    let message = Geodesics::new(&mesh.positions[1..], &mesh.triangles()).unwrap_err().to_string();
    assert!(message.contains("there are 41"), "{message}");
    let geodesics = Geodesics::new(&mesh.positions, &mesh.triangles()).unwrap();
    assert!(farthest_points(&geodesics, 42, 5).is_empty());
    assert_eq!(farthest_points(&geodesics, 41, 5).len(), 5);
    assert_eq!(geodesics.matrix(&[0, 42], || Ok(())).unwrap(), [0.0, f64::INFINITY, f64::INFINITY, f64::INFINITY]);
}

#[test]
fn layers_and_pairs_of_another_mesh_are_refused() {
    let mut mesh = icosphere(1.0, 1);
    let layer = mesh.positions[1..].to_vec();
    assert!(
        weld(&mut mesh, Weld::Exact, &[&layer]).unwrap_err().to_string().contains("layer 0 has 41 positions for 42")
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pairs.json");
    let on = [SurfacePoint::new(0, [1.0, 0.0, 0.0])];
    let off = [SurfacePoint::new(80, [1.0, 0.0, 0.0])];
    assert!(write_pairs(&path, (&mesh, &on), (&mesh, &[]), &[]).is_err());
    assert!(write_pairs(&path, (&mesh, &on), (&mesh, &off), &[]).unwrap_err().to_string().contains("no face 80"));
    assert!(!path.exists());
    write_pairs(&path, (&mesh, &on), (&mesh, &on), &[]).unwrap();
}

/// A mesh with what belongs to it.
struct Side(Mesh, Topology, Embedding);

impl Side {
    fn new(mesh: Mesh) -> Self {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 30, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
        Self(mesh, topology, embedding)
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.0, topology: &self.1, embedding: Some(&self.2) }
    }
}

#[test]
fn a_map_refuses_what_belongs_to_another_mesh() {
    let (source, target) = (Side::new(icosphere(1.0, 2)), Side::new(uv_sphere(1.0, 12, 8)));
    let points = |s: &Side| [0u32, 20, 40, 60].map(|v| vertex_point(&s.0, &s.1, v, "anchor").unwrap()).to_vec();
    let anchors = AnchorPairs { source: points(&source), target: points(&target) };
    let mut elsewhere = anchors.clone();
    elsewhere.target[1].face = 100_000;
    let mut nowhere = anchors.clone();
    nowhere.source[2].barycentric = [f64::NAN; 3];
    for method in [Method::Averages, Method::Transport, Method::Field, Method::Rbf, Method::Closest] {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        let make = |a: Shape<'_>, b: Shape<'_>, pairs: &AnchorPairs| correspondence(a, b, pairs, &options);
        let (a, b) = (source.shape(), target.shape());
        for pairs in [&elsewhere, &nowhere, &AnchorPairs { source: points(&source), target: Vec::new() }] {
            assert!(make(a, b, pairs).is_err(), "{method:?}");
        }
        // The adjacency, then the embedding, of the other mesh.
        assert!(make(Shape { topology: &target.1, ..a }, b, &anchors).is_err(), "{method:?}: adjacency");
        if method.needs_embedding() {
            assert!(make(Shape { embedding: b.embedding, ..a }, b, &anchors).is_err(), "{method:?}: embedding");
            assert!(make(a, Shape { embedding: a.embedding, ..b }, &anchors).is_err(), "{method:?}: embedding");
        }
        let map = make(a, b, &anchors).unwrap();
        for face in [target.0.triangle_count() as u32, NONE] {
            let beyond = PackedPoint { face, b0: 0.3, b1: 0.3 };
            assert!(map.map(&[beyond], &mut Vec::new()).is_err(), "{method:?}: face {face}");
        }
    }
}

#[test]
fn a_transfer_refuses_pictures_and_colours_that_do_not_fit() {
    let mesh = uv_sphere(1.0, 12, 8);
    let options = TransferOptions { width: 16, height: 16, ..TransferOptions::default() };
    let fails = |source: &Mesh, layer: Layer<'_>, options: &TransferOptions| {
        transfer_on(&Engine::cpu(), source, &[layer], &mesh, &IdentityMap, options, &Quiet).err().map(|e| e.to_string())
    };
    let good = Image::zeros(4, 4, 3, Depth::U8).unwrap();
    assert_eq!(fails(&mesh, Layer::single("colour", &good), &options), None);
    let short = Image { pixels: Pixels::U8(vec![0; 47]), ..good.clone() };
    let flat = Image { height: 0, ..good.clone() };
    let wide = Image { channels: 5, ..good.clone() };
    for image in [&short, &flat, &wide] {
        assert!(
            fails(&mesh, Layer::single("colour", image), &options).is_some(),
            "{} {}",
            image.height,
            image.channels
        );
    }
    assert!(fails(&mesh, Layer::of_vertices("colour", &[[0.0; 4]; 3]), &options).is_some());
    assert!(fails(&mesh, Layer::single("colour", &good), &TransferOptions { width: 0, ..options.clone() }).is_some());
    // A map to triangles that the source does not have.
    let one = Mesh::from_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]).unwrap();
    assert!(fails(&one, Layer::single("colour", &good), &options).is_some());
}
