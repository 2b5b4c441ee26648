//! The paper's Gauss-Seidel sweeps towards equation 16 = 0.

use super::decode::ring_value;
use super::derivative::{Linearisation, blocks};
use super::vector::{add, sub};
use super::{Encoding, Stencils, V3};
use crate::geometry::NONE;

/// `count` sweeps v_i <- F_i + sum_j (dF_j/dv_i)ᵀ (v_j - F_j) over the vertices from `held` on, in
/// order, with the derivatives of the beginning of each sweep (section 3.2.2, equation 16).
pub(crate) fn gauss_seidel(
    stencils: &Stencils,
    encoding: &Encoding<f64>,
    held: usize,
    count: usize,
    positions: &mut [V3<f64>],
) {
    let value = |row: usize, x: &[V3<f64>]| {
        let slots = stencils.slots(row);
        ring_value(x, &stencils.neighbour[slots.clone()], &encoding.w[slots.clone()], &encoding.b[slots])
    };
    for _ in 0..count {
        let at = Linearisation::new(stencils, encoding, positions);
        let blocks = blocks(stencils, encoding, &at, positions);
        for v in held..positions.len() {
            let own = stencils.row_of[v];
            if own == NONE {
                continue;
            }
            let mut x = value(own as usize, positions);
            for &slot in stencils.incoming(v) {
                let row = stencils.slot_row[slot as usize] as usize;
                let r = sub(positions[stencils.vertex[row] as usize], value(row, positions));
                let b = &blocks[slot as usize];
                x = add(x, std::array::from_fn(|c| b[c] * r[0] + b[3 + c] * r[1] + b[6 + c] * r[2]));
            }
            positions[v] = x;
        }
    }
}
