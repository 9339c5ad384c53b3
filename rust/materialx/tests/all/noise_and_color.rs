// SPDX-License-Identifier: Apache-2.0
//! Noise and colour operations against the results of `MaterialX`'s own functions (`noise_and_color.csv` names them):
//! the same bits.

use oocpt_materialx::eval::evaluate;
use oocpt_materialx::program::Op;

const TABLE: &str = include_str!("../data/noise_and_color.csv");
const OPS: [Op; 12] = [
    Op::RgbToHsv,
    Op::HsvToRgb,
    Op::Noise2,
    Op::Noise2Vector,
    Op::Noise3,
    Op::Noise3Vector,
    Op::CellNoise2,
    Op::CellNoise3,
    Op::Worley2,
    Op::Worley3,
    Op::Fractal2,
    Op::Fractal3,
];

/// Operation, immediate, operands, result.
type Row = (Op, u16, [[f32; 4]; 3], [f32; 4]);

fn row(line: &str) -> Row {
    let (op, rest) = line.split_once(',').expect("an operation");
    let (immediate, numbers) = rest.split_once(',').expect("an immediate");
    let op = OPS.into_iter().find(|known| format!("{known:?}") == op).expect("a known one");
    let n: Vec<f32> = numbers.split(',').map(|x| x.parse().expect("a number")).collect();
    assert_eq!(n.len(), 10, "{line}: numbers");
    let operands = [[n[0], n[1], n[2], 0.0], [n[3], n[4], n[5], 0.0], [0.0; 4]];
    (op, immediate.parse().expect("a number"), operands, [n[6], n[7], n[8], n[9]])
}

#[test]
fn noise_and_color_match_materialx_bit_for_bit() {
    let rows: Vec<Row> = TABLE.lines().filter(|line| !line.starts_with('#')).map(row).collect();
    for op in OPS {
        assert_eq!(rows.iter().filter(|row| row.0 == op).count(), 50, "{op:?}: rows");
    }
    let mut wrong = Vec::new();
    for (op, immediate, operands, expected) in rows {
        let result = evaluate(op, operands, immediate);
        if result.map(f32::to_bits) != expected.map(f32::to_bits) {
            wrong.push(format!("{op:?} {immediate} of {operands:?}: {result:?}, not {expected:?}"));
        }
    }
    assert!(wrong.is_empty(), "{} rows: {}", wrong.len(), wrong.join("\n"));
}
