// Surfaces with interpolated tangent planes: tables, Psi. Reference and explanation: surface::psi.
// The dimension is that of the Vector which the kernel imports (lib/vector8 or lib/vector12).

//#import lib/none
//#import lib/table

// Texels of a vertex (point, two rows of the tangent basis, stops) and of a triangle, as the host
// writes them into its tables.
const VERTEX_TEXELS: u32 = 3u * VECTOR_TEXELS + 1u;
const TRIANGLE_TEXELS: u32 = 5u;

// Below this s a point counts as a vertex; psi::at_vertex.
const AT_VERTEX: f32 = 9.5367431640625e-7;

// A vertex: its point and the rows of the basis of its tangent plane.
struct Corner {
    y: Vector,
    a: Vector,
    b: Vector,
}

fn vertex_point(vertices: texture_2d<u32>, v: u32) -> Vector {
    let i = v * VERTEX_TEXELS;
    return texel_vector(vertices, i);
}

fn corner(vertices: texture_2d<u32>, v: u32) -> Corner {
    let i = v * VERTEX_TEXELS;
    return Corner(
        texel_vector(vertices, i),
        texel_vector(vertices, i + VECTOR_TEXELS),
        texel_vector(vertices, i + 2u * VECTOR_TEXELS),
    );
}

// G_0 to G_5 as columns: G = [[c, -f s], [s, f c]].
struct Gauge {
    g0: mat2x2f,
    g1: mat2x2f,
    g2: mat2x2f,
    g3: mat2x2f,
    g4: mat2x2f,
    g5: mat2x2f,
}

fn orthogonal2(g: vec2f, mirrored: bool) -> mat2x2f {
    let f = select(1.0, -1.0, mirrored);
    return mat2x2f(g.x, g.y, -f * g.y, f * g.x);
}

// `signs`: bit k is set where G_k is a reflection.
fn gauge(triangles: texture_2d<u32>, face: u32, signs: u32) -> Gauge {
    let i = face * TRIANGLE_TEXELS;
    let a = texel_f32(triangles, i + 2u);
    let b = texel_f32(triangles, i + 3u);
    let c = texel_f32(triangles, i + 4u);
    return Gauge(
        orthogonal2(a.xy, (signs & 1u) != 0u),
        orthogonal2(a.zw, (signs & 2u) != 0u),
        orthogonal2(b.xy, (signs & 4u) != 0u),
        orthogonal2(b.zw, (signs & 8u) != 0u),
        orthogonal2(c.xy, (signs & 16u) != 0u),
        orthogonal2(c.zw, (signs & 32u) != 0u),
    );
}

// m_0 to m_5, or with division by s, c_0 to c_5.
struct Coefficients {
    a: vec3f,
    b: vec3f,
}

fn unscaled_coefficients(x: vec3f) -> Coefficients {
    let h = 0.5 * x.x * x.y * x.z;
    return Coefficients(
        vec3f(x.x * x.x * x.y + h, x.x * x.y * x.y + h, x.y * x.y * x.z + h),
        vec3f(x.y * x.z * x.z + h, x.z * x.z * x.x + h, x.z * x.x * x.x + h),
    );
}

fn coefficients(x: vec3f) -> Coefficients {
    let s = x.x * x.y + x.y * x.z + x.z * x.x;
    if s <= AT_VERTEX {
        if x.x >= x.y && x.x >= x.z {
            return Coefficients(vec3f(0.5, 0.0, 0.0), vec3f(0.0, 0.0, 0.5));
        }
        if x.y >= x.z {
            return Coefficients(vec3f(0.0, 0.5, 0.5), vec3f());
        }
        return Coefficients(vec3f(), vec3f(0.5, 0.5, 0.0));
    }
    let m = unscaled_coefficients(x);
    let r = 1.0 / s;
    return Coefficients(m.a * r, m.b * r);
}
