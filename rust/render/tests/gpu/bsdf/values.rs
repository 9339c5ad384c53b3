// SPDX-License-Identifier: Apache-2.0
//! Values: those of the definition, symmetric, those of the samples; Lambert where nothing reflects; finite for any
//! input.

use super::cases::{Case, Random, SPECULAR_WORKFLOW, direction};
use super::device::{ALL, Answer, Device, PLAIN};
use super::energy::tilted;
use super::reference::Reference;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

fn far(a: DVec3, b: DVec3) -> f64 {
    let size = a.abs().max(b.abs()).max_element();
    (a - b).abs().max_element() / size.max(1e-6)
}

#[test]
fn bsdf_values_match_the_f64_definition() {
    let device = Device::new(ALL);
    let mut random = Random(1);
    let mut cases: Vec<Case> = (0..160).map(|_| Case { opacity: 1.0, ..random.case() }).collect();
    for case in cases.iter_mut().skip(80) {
        // Near the mirror direction, so that sharp lobes count.
        case.roughness = 0.05 + 0.5 * case.roughness;
        let mirror = DVec3::new(-case.wo.x, -case.wo.y, case.wo.z);
        case.wi = (mirror + case.wi * case.roughness.powi(2)).normalize();
        case.wo.z = case.wo.z.max(0.05);
        case.wo = case.wo.normalize();
    }
    // These hardly reflect head on, where F90 fades: by ior, and by colour.
    for (at, case) in cases.iter_mut().enumerate().filter(|(at, _)| at % 8 < 2) {
        (case.metallic, case.flags) = (0.0, if at % 8 == 0 { 0 } else { SPECULAR_WORKFLOW });
        (case.ior, case.specular) = (1.0 + 0.02 * (case.ior - 1.0), 8e-4 * case.specular);
    }
    for case in &mut cases {
        case.roughness = case.roughness.max(0.15);
        // At smaller cosines and for narrower lobes the reference's quadrature is not accurate enough; the furnace and
        // reciprocity test those.
        case.wi = DVec3::new(case.wi.x, case.wi.y, case.wi.z.max(0.1)).normalize();
        case.wo = DVec3::new(case.wo.x, case.wo.y, case.wo.z.max(0.1)).normalize();
    }
    let mut worst = [0.0_f64; 3];
    for (case, answer) in cases.iter().zip(device.cases(&cases)) {
        let reference = Reference::new(case);
        let [diffuse, single, multiple] = reference.evaluate();
        let specular = single + multiple;
        let pdf: f64 = reference.densities().iter().zip(answer.chance).map(|(d, c)| d * c).sum();
        // Relative to the value and to white; multiple scattering of narrow lobes is a few per mille of light known to
        // a tenth.
        let white = 0.2 * case.wi.z / PI;
        let off = |a: DVec3, b: DVec3, more: DVec3| ((a - b).abs() / (a + 5.0 * more + white)).max_element();
        let diffuse_error = off(diffuse, answer.diffuse, DVec3::ZERO);
        let errors = [diffuse_error, off(specular, answer.specular, multiple), (pdf - answer.given_pdf).abs() / pdf];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
        assert!(errors.iter().all(|e| *e < 0.02), "{errors:?}: {diffuse} {specular} {pdf}, not {answer:?} of {case:?}");
    }
    println!("largest relative errors: diffuse {:.1e}, specular {:.1e}, density {:.1e}", worst[0], worst[1], worst[2]);
    device.close();
}

/// Measures how well f32 directions resolve narrow lobes, which decides which lobes are sharp.
#[test]
fn narrow_lobes_are_resolved() {
    let device = Device::new(PLAIN);
    let mut random = Random(11);
    for (roughness, bound) in [(0.01, 2e-2), (0.02, 5e-3), (0.03, 2e-3), (0.1, 4e-4), (0.3, 1e-4)] {
        let of = |random: &mut Random| {
            let wo = direction(0.1 + 0.9 * random.unit(), 6.0 * random.unit());
            Case { wo, u: random.units(), roughness, metallic: 1.0, ..Case::default() }
        };
        let cases: Vec<Case> = (0..500).map(|_| of(&mut random)).collect();
        let mut errors = Vec::new();
        for (case, answer) in cases.iter().zip(device.cases(&cases)) {
            if answer.ok && answer.u_is_specular(case) && answer.pdf > 0.0 {
                let here = Case { wi: answer.sampled, ..*case };
                let exact = Density::of(&here);
                let alpha = roughness * roughness;
                let scatter = 1.0 / (2.0 * PI * (answer.sampled.z + alpha) * (1.0 + 1.0 / alpha).ln());
                let specular = (answer.pdf - answer.chance[3] * scatter) / answer.chance[1];
                errors.push((specular / exact - 1.0).abs());
            }
        }
        errors.sort_by(f64::total_cmp);
        let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
        println!(
            "roughness {roughness}: density off by {median:.1e} (median), {worst:.1e} (largest of {})",
            errors.len()
        );
        assert!(worst < bound, "roughness {roughness}: {worst}");
    }
    device.close();
}

/// The density of a metal's samples at the f32 directions, computed in f64.
struct Density;

impl Density {
    fn of(case: &Case) -> f64 {
        let case = case.rounded();
        let (o, i) = (case.wo.normalize(), case.wi.normalize());
        let h = (o + i).normalize();
        let a2 = case.roughness.powi(4);
        let spread = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
        let slope = (o.z * o.z + a2 * (1.0 - o.z * o.z)).sqrt();
        a2 / (PI * spread * spread) / (2.0 * (o.z + slope))
    }
}

impl Answer {
    /// Returns true if the specular layer made the sample, and by far outweighs the broad lobe.
    fn u_is_specular(&self, case: &Case) -> bool {
        self.chance[1] > 0.99 && f64::from(case.u[2]) < self.chance[1]
    }
}

/// Reflection is reciprocal, to the precision of f32.
pub(super) fn expect_reciprocal(device: &Device, cases: &[Case]) {
    let swapped: Vec<Case> = cases.iter().map(|c| Case { wo: c.wi, wi: c.wo, ..*c }).collect();
    let mut worst: f64 = 0.0;
    for ((case, there), back) in cases.iter().zip(device.cases(cases)).zip(device.cases(&swapped)) {
        for (a, b) in [(there.diffuse, back.diffuse), (there.specular, back.specular)] {
            // The loss of single scattering is a difference of ones in f32.
            let (a, b) = (a / case.wi.z, b / case.wo.z);
            let error = ((a - b).abs() / (a.max(b) + 1e-3)).max_element();
            worst = worst.max(error);
            assert!(error < 1e-3, "{error}: {a} and {b} of {case:?}");
        }
    }
    println!("largest relative difference {worst:.1e}");
}

#[test]
fn reflection_is_reciprocal() {
    let device = Device::new(ALL);
    let mut random = Random(2);
    let cases: Vec<Case> = (0..20_000).map(|_| random.case()).collect();
    expect_reciprocal(&device, &cases);
    device.close();
}

#[test]
fn transmission_is_reciprocal_and_refracts() {
    let device = Device::new(ALL);
    let mut random = Random(3);
    let through = |random: &mut Random| {
        let opacity = 0.9 * random.unit();
        let wo = direction(0.02 + 0.98 * random.unit(), 6.0 * random.unit());
        let u = [0.5, 0.5, 0.999_999_9];
        Case { opacity, metallic: 0.0, roughness: 0.0, coat: 0.0, wo, u, ..random.case() }
    };
    let cases: Vec<Case> = (0..5000).map(|_| through(&mut random)).collect();
    let there = device.cases(&cases);
    let back: Vec<Case> = cases.iter().zip(&there).map(|(c, a)| Case { wo: a.sampled, ..*c }).collect();
    let back = device.cases(&back);
    let mut worst = [0.0_f64; 2];
    for ((case, a), b) in cases.iter().zip(&there).zip(&back) {
        assert!(a.ok && a.pdf == 0.0 && a.sampled.z < 0.0, "goes through: {a:?} of {case:?}");
        let case = case.rounded();
        let bent = DVec3::new(case.wo.x, case.wo.y, 0.0) / case.ior;
        let expected = DVec3::new(-bent.x, -bent.y, -(1.0 - bent.length_squared()).sqrt());
        worst[0] = worst[0].max((a.sampled - expected).length());
        let share = |answer: &Answer| answer.weight * answer.chance[4] * answer.lets_through;
        let shares = (share(a), share(b));
        // The way back starts at a direction rounded to f32, which at grazing angles outside is a different one.
        let error = far(shares.0, shares.1) * case.wo.z.powi(2);
        worst[1] = worst[1].max(error);
        assert!(b.sampled.distance(case.wo) * case.wo.z < 1e-5, "and back: {b:?} of {case:?}");
        assert!(error < 1e-4, "{shares:?} of {case:?}");
    }
    println!("Snell to {:.1e}, shares to {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-6, "Snell's law: {}", worst[0]);
    device.close();
}

/// Glass is a closed form: Fresnel's equations.
#[test]
fn smooth_glass_is_fresnel() {
    let device = Device::new(ALL);
    for ior in [1.0, 1.0001, 1.33, 1.5, 3.0] {
        let cosines: Vec<f64> = (1..=100).map(|i| f64::from(i) / 100.0).collect();
        let of = |c: &f64| Case { wo: direction(*c, 1.0), ior, roughness: 0.0, opacity: 0.0, ..Case::default() };
        let inside = |c: &f64| Case { wo: -direction(*c, 1.0), ..of(c) };
        for (eta, cases) in
            [(1.0 / ior, cosines.iter().map(of).collect::<Vec<_>>()), (ior, cosines.iter().map(inside).collect())]
        {
            for (case, answer) in cases.iter().zip(device.cases(&cases)) {
                let case = case.rounded();
                let c = case.wo.z.abs();
                let sine2 = eta * eta * (1.0 - c * c);
                let t = (1.0 - sine2).max(0.0).sqrt();
                let (s, p) = ((eta * c - t) / (eta * c + t), (eta * t - c) / (eta * t + c));
                let reflected = if sine2 >= 1.0 { 1.0 } else { 0.5 * (s * s + p * p) };
                let error = (answer.chance[4] * answer.lets_through - (1.0 - reflected)).abs();
                let near_critical = (sine2 - 1.0).abs() < 1e-5;
                assert!(error < 1e-4 || near_critical, "ior {ior}, cosine {c}: {answer:?}, not {reflected}");
                assert!((answer.weight - DVec3::ONE).abs().max_element() < 1e-5, "nothing is lost: {answer:?}");
            }
        }
    }
    device.close();
}

#[test]
fn weights_are_values_over_densities() {
    let device = Device::new(ALL);
    let mut random = Random(4);
    let mut cases: Vec<Case> = (0..20_000).map(|_| random.case()).collect();
    cases.extend((0..20_000).map(|_| tilted(&mut random)));
    let mut made = 0;
    let answers = device.cases(&cases);
    let again: Vec<Case> = cases.iter().zip(&answers).map(|(c, a)| Case { wi: a.sampled, ..*c }).collect();
    for ((case, a), given) in cases.iter().zip(&answers).zip(device.cases(&again)) {
        if !a.ok {
            continue;
        }
        let side = case.wo.dot(case.g).signum() * a.sampled.dot(case.g);
        assert!((a.sampled.length() - 1.0).abs() < 1e-5, "unit: {a:?} of {case:?}");
        if a.pdf > 0.0 {
            made += 1;
            assert!(side > 0.0 || case.opacity < 1.0, "on the viewer's side: {a:?} of {case:?}");
            assert!(far(a.weight * a.pdf, a.value) < 1e-5, "{a:?} of {case:?}");
            assert_eq!((a.pdf, given.given_pdf), (a.value_pdf, a.pdf), "density, {case:?}");
            assert_eq!(a.value, (given.diffuse.as_vec3() + given.specular.as_vec3()).as_dvec3(), "parts, {case:?}");
        }
    }
    assert!(made > 15_000, "samples that are not sharp: {made}");
    device.close();
}

#[test]
fn without_reflection_it_is_lambert() {
    let device = Device::new(ALL);
    let mut random = Random(5);
    let of = |random: &mut Random| {
        let flags = SPECULAR_WORKFLOW;
        Case { specular: DVec3::ZERO, flags, opacity: 1.0, coat: 0.0, ..tilted(random) }
    };
    let mut cases: Vec<Case> = (0..5000).map(|_| of(&mut random)).collect();
    for case in cases.iter_mut().skip(2500) {
        (case.flags, case.metallic, case.ior) = (0, 0.0, 1.0);
    }
    for (case, a) in cases.iter().zip(device.cases(&cases)) {
        let case = case.rounded();
        assert_eq!(a.weight, case.diffuse, "weight, {case:?}");
        let side = case.wo.dot(case.g).signum();
        let (g, n) = (case.g * side, case.n * case.n.dot(case.g).signum() * side);
        let density = |w: DVec3| {
            let mirrored = w - 2.0 * g.dot(w) * g;
            if g.dot(w) > 0.0 { (n.dot(w).max(0.0) + n.dot(mirrored).max(0.0)) / PI } else { 0.0 }
        };
        assert!((density(a.sampled) - a.pdf).abs() < 2e-6, "density, {a:?} of {case:?}");
        assert!(far(case.diffuse * density(case.wi), a.diffuse) < 1e-4 || density(case.wi) < 1e-4, "{a:?} of {case:?}");
        assert_eq!(a.specular, DVec3::ZERO, "nothing else, {case:?}");
    }
    device.close();
}

#[test]
fn out_of_range_input_gives_finite_values() {
    let device = Device::new(ALL);
    let mut random = Random(6);
    let unit = [0.0, 1.0, 1e-8, 1e-4, 0.01, 0.009_999, 0.5, 0.999_999, f64::NAN, f64::INFINITY, -1.0, 2.0];
    let tiny = [0.0, 0.0, 1e-20, 1e-7, 1e-3, 1.0, -1e-7, -1.0];
    let mut any = 0_usize;
    let mut wrong: BTreeMap<String, (usize, String)> = BTreeMap::new();
    for _ in 0..10 {
        let cases: Vec<Case> = (0..100_000).map(|_| strange(&mut random, &unit, &tiny)).collect();
        for (case, a) in cases.iter().zip(device.cases(&cases)) {
            any += usize::from(a.ok);
            for what in a.what_is_strange() {
                let told =
                    || format!("of {case:?}\n  answer {:?}\n  input {:08x?}", a.raw, case.floats().map(f32::to_bits));
                wrong.entry(what).or_insert_with(|| (0, told())).0 += 1;
            }
        }
    }
    // All kinds are reported with their first case, for devices that round in another way and are not at hand.
    let told: Vec<String> =
        wrong.iter().map(|(what, (count, case))| format!("{what}, {count} times: {case}")).collect();
    assert!(told.is_empty(), "of 10^6 answers:\n{}", told.join("\n"));
    println!("{any} of 10^6 made a direction");
    assert!(any > 700_000, "most make a direction: {any}");
    device.close();
}

impl Answer {
    /// Every number that is not finite, every negative one that cannot be, and a direction that is not unit.
    fn what_is_strange(&self) -> Vec<String> {
        const PARTS: [(&str, usize); 11] = [
            ("ok", 1),
            ("direction", 4),
            ("weight", 7),
            ("density", 8),
            ("value", 11),
            ("value's density", 12),
            ("diffuse at wi", 15),
            ("specular at wi", 18),
            ("density at wi", 19),
            ("chances of coat, specular, diffuse, scattering, glass and its scattering", 25),
            ("what is about glass", 28),
        ];
        let mut found = Vec::new();
        let mut first = 0;
        for (name, end) in PARTS {
            let part = &self.raw[first..end];
            if part.iter().any(|x| !x.is_finite()) {
                found.push(format!("{name} not finite"));
            } else if first >= 4 && part.iter().any(|x| *x < 0.0) {
                found.push(format!("{name} negative"));
            }
            first = end;
        }
        let length = self.sampled.length();
        if (length - 1.0).abs() >= 1e-4 {
            found.push("direction not unit".to_owned());
        }
        found
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the purpose")]
fn single(x: f64) -> f32 {
    x as f32
}

fn strange(random: &mut Random, unit: &[f64], tiny: &[f64]) -> Case {
    let mut vector = || {
        let v = DVec3::new(random.pick(tiny), random.pick(tiny), random.pick(tiny));
        if v.length() > 1e-30 { v.normalize() } else { DVec3::Z }
    };
    let (g, n, wo, wi) = (vector(), vector(), vector(), vector());
    let mut color = || DVec3::new(random.pick(unit), random.pick(unit), random.pick(unit));
    let (diffuse, specular) = (color(), color());
    Case {
        g,
        n,
        wo,
        wi: if random.unit() < 0.2 { -wo } else { wi },
        u: [random.pick(&[0.0, 0.5, 0.999_999_94]), random.pick(&[0.0, 0.5, 0.999_999_94]), random.unit()].map(single),
        diffuse,
        specular,
        metallic: random.pick(unit),
        roughness: random.pick(unit),
        ior: random.pick(&[0.0, 1.0, 1.0001, 1.000_000_1, 1.5, 3.0, 1e30, -1.0, f64::NAN, f64::INFINITY]),
        coat: random.pick(unit),
        coat_roughness: random.pick(unit),
        opacity: random.pick(unit),
        flags: u32::from(random.unit() < 0.3) * SPECULAR_WORKFLOW,
        ..Case::default()
    }
}
