// SPDX-License-Identifier: Apache-2.0
//! Measured profiles of luminaires: IES files (ANSI/IES LM-63, 1986 to 2019). Pure; the bytes come from outside.
//!
//! Guarantees: no allocation is larger than the file allows; every number of a profile is finite, candelas are not
//! negative, angles grow. Only type C photometry is read (the usual one): vertical angle 0 is straight down, which is
//! where a light points.

use std::f64::consts::PI;

/// Longest file that is read, bytes.
const MAX_BYTES: usize = 16 << 20;
/// Most angles in one direction.
const MAX_ANGLES: usize = 4096;

/// Why a profile cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IesError {
    /// The file is larger than any profile.
    #[error("the file is larger than {MAX_BYTES} bytes")]
    TooLarge,
    /// There is no `TILT=` line.
    #[error("no TILT line: not an IES profile")]
    NoTilt,
    /// The tilt is in another file.
    #[error("TILT of another file is not supported")]
    TiltFile,
    /// The file ends early or holds something that is no number.
    #[error("{0} is missing or not a number")]
    Number(&'static str),
    /// A count is out of range.
    #[error("{0} is out of range")]
    Range(&'static str),
    /// Photometry of type A or B.
    #[error("photometry of type {0} is not supported (type C is)")]
    Photometry(&'static str),
    /// Angles that do not grow.
    #[error("{0} angles do not grow")]
    Order(&'static str),
}

/// A profile: candelas over vertical (0 = down, 180 = up) and horizontal angles, degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct IesProfile {
    /// At least one; grow.
    pub vertical: Vec<f32>,
    /// The whole circle, 0 to 360; or just 0 for a profile that is the same all around.
    pub horizontal: Vec<f32>,
    /// `candela[h * vertical.len() + v]`.
    pub candela: Vec<f32>,
    /// Integral of the candelas over the sphere: lumens.
    pub power: f64,
}

struct NumberTokens<'a>(Box<dyn Iterator<Item = &'a str> + 'a>);

impl NumberTokens<'_> {
    fn next(&mut self, what: &'static str) -> Result<f64, IesError> {
        let word = self.0.next().ok_or(IesError::Number(what))?;
        let value: f64 = word.parse().ok().filter(|v: &f64| v.is_finite()).ok_or(IesError::Number(what))?;
        Ok(value)
    }

    fn count(&mut self, what: &'static str) -> Result<usize, IesError> {
        let value = self.next(what)?;
        let in_range = value >= 1.0 && value <= MAX_ANGLES as f64 && value.fract() == 0.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be small and whole")]
        let count = value as usize;
        if in_range { Ok(count) } else { Err(IesError::Range(what)) }
    }

    fn list(&mut self, count: usize, what: &'static str) -> Result<Vec<f32>, IesError> {
        // Grows with what is there, not with what the file says.
        let mut list = Vec::new();
        for _ in 0..count {
            let value = super::narrow(self.next(what)?);
            if !value.is_finite() {
                return Err(IesError::Number(what));
            }
            list.push(value);
        }
        Ok(list)
    }
}

impl IesProfile {
    /// Reads a file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(bytes: &[u8]) -> Result<Self, IesError> {
        if bytes.len() > MAX_BYTES {
            return Err(IesError::TooLarge);
        }
        let text = String::from_utf8_lossy(bytes);
        let (tilt, rest) = after_tilt(&text).ok_or(IesError::NoTilt)?;
        let words = rest.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
        let mut numbers = NumberTokens(Box::new(words));
        match tilt {
            "NONE" => {}
            "INCLUDE" => {
                numbers.next("lamp-to-luminaire geometry")?;
                let pairs = numbers.count("number of tilt angles")?;
                numbers.list(2 * pairs, "tilt")?;
            }
            _ => return Err(IesError::TiltFile),
        }
        numbers.next("number of lamps")?;
        numbers.next("lumens per lamp")?;
        let multiplier = numbers.next("candela multiplier")?;
        let (vertical, horizontal) =
            (numbers.count("number of vertical angles")?, numbers.count("number of horizontal angles")?);
        let photometry = numbers.next("photometric type")?;
        for what in ["units", "width", "length", "height"] {
            numbers.next(what)?;
        }
        let (ballast, _, _) =
            (numbers.next("ballast factor")?, numbers.next("future use")?, numbers.next("input watts")?);
        if photometry > 1.5 {
            return Err(IesError::Photometry(if photometry > 2.5 { "A" } else { "B" }));
        }
        let vertical = numbers.list(vertical, "vertical angle")?;
        let horizontal = numbers.list(horizontal, "horizontal angle")?;
        let candela = numbers.list(vertical.len() * horizontal.len(), "candela value")?;
        let scale = multiplier * ballast;
        let candela: Vec<f32> = candela.iter().map(|&c| super::narrow((f64::from(c) * scale).max(0.0))).collect();
        if !candela.iter().all(|c| c.is_finite()) {
            return Err(IesError::Range("candela multiplier"));
        }
        let (horizontal, candela) = around(&vertical, horizontal, candela)?;
        let mut profile = Self { vertical, horizontal, candela, power: 0.0 };
        profile.power = profile.integral();
        Ok(profile)
    }

    /// Candelas at `theta` (0 = down) and `phi`, radians; linear in between, 0 outside the vertical angles.
    #[must_use]
    pub fn candela(&self, theta: f64, phi: f64) -> f64 {
        let theta = theta.to_degrees();
        let (first, last) = (self.vertical.first().copied(), self.vertical.last().copied());
        if theta < f64::from(first.unwrap_or(0.0)) - 1e-6 || theta > f64::from(last.unwrap_or(0.0)) + 1e-6 {
            return 0.0;
        }
        let (v, dv) = find(&self.vertical, theta);
        let (h, dh) = find(&self.horizontal, phi.to_degrees().rem_euclid(360.0));
        let at = |h: usize, v: usize| {
            let h = h.min(self.horizontal.len().saturating_sub(1));
            let v = v.min(self.vertical.len().saturating_sub(1));
            f64::from(self.candela.get(h * self.vertical.len() + v).copied().unwrap_or(0.0))
        };
        let column = |h: usize| at(h, v) * (1.0 - dv) + at(h, v + 1) * dv;
        column(h) * (1.0 - dh) + column(h + 1) * dh
    }

    /// Mean candelas over the sphere, or over a half of it where the profile says no more than that: what `UsdLux`'s
    /// `ies:normalize` divides by (as `hdEmbree`, Karma and RIS do).
    #[must_use]
    pub fn mean(&self) -> f64 {
        // What hdEmbree allows a half to have.
        const HALF: f64 = 0.5 * PI + 0.1;
        let extent = |ends: (&f32, &f32)| (f64::from(*ends.1) - f64::from(*ends.0)).to_radians();
        let is_half = self.vertical.first().zip(self.vertical.last()).map_or(0.0, extent) <= HALF;
        self.power / (if is_half { 2.0 } else { 4.0 } * PI)
    }

    /// Largest candela value.
    #[must_use]
    pub fn peak(&self) -> f32 {
        self.candela.iter().copied().fold(0.0, f32::max)
    }

    /// Midpoint rule; cells are finer than any luminaire's angles.
    fn integral(&self) -> f64 {
        const STEPS: u32 = 720;
        let turns: u32 = if self.horizontal.len() > 1 { 360 } else { 1 };
        let (dt, dp) = (PI / f64::from(STEPS), 2.0 * PI / f64::from(turns));
        let ring = |i: u32| {
            let theta = (f64::from(i) + 0.5) * dt;
            let sum: f64 = (0..turns).map(|j| self.candela(theta, (f64::from(j) + 0.5) * dp)).sum();
            sum * theta.sin()
        };
        (0..STEPS).map(ring).sum::<f64>() * dt * dp
    }
}

/// What `TILT=` says, and all that follows its line.
fn after_tilt(text: &str) -> Option<(&str, &str)> {
    let start = text.find("TILT=")? + "TILT=".len();
    let rest = text.get(start..)?;
    let end = rest.find(['\r', '\n']).unwrap_or(rest.len());
    Some((rest.get(..end)?.trim(), rest.get(end..)?))
}

/// Index and fraction of `x` in the growing `values`.
fn find(values: &[f32], x: f64) -> (usize, f64) {
    let above = values.partition_point(|&v| f64::from(v) <= x);
    let low = above.saturating_sub(1);
    let (Some(&a), Some(&b)) = (values.get(low), values.get(low + 1)) else {
        return (low, 0.0);
    };
    let (a, b) = (f64::from(a), f64::from(b));
    (low, ((x - a) / (b - a)).clamp(0.0, 1.0))
}

fn grows(values: &[f32]) -> bool {
    values.windows(2).all(|pair| pair[0] < pair[1])
}

/// Horizontal angles and candelas all around, from a quarter, a half or the whole circle.
fn around(vertical: &[f32], horizontal: Vec<f32>, candela: Vec<f32>) -> Result<(Vec<f32>, Vec<f32>), IesError> {
    if !grows(vertical) {
        return Err(IesError::Order("vertical"));
    }
    if !grows(&horizontal) {
        return Err(IesError::Order("horizontal"));
    }
    let rows = vertical.len();
    let (Some(&first), Some(&last)) = (horizontal.first(), horizontal.last()) else {
        return Err(IesError::Range("number of horizontal angles"));
    };
    if horizontal.len() == 1 {
        return Ok((vec![0.0], candela));
    }
    let mut columns: Vec<(f32, Vec<f32>)> =
        horizontal.iter().copied().zip(candela.chunks(rows).map(<[f32]>::to_vec)).collect();
    let mirror = |columns: &mut Vec<(f32, Vec<f32>)>, at: f32| {
        let mirrored: Vec<_> = columns.iter().rev().map(|(angle, column)| (2.0 * at - angle, column.clone())).collect();
        columns.extend(mirrored.into_iter().filter(|(angle, _)| *angle > at + 1e-3));
    };
    let is_at = |value: f32, at: f32| (value - at).abs() < 1e-3;
    if is_at(first, 90.0) && is_at(last, 270.0) {
        // Symmetric about the 90-270 plane: turn to 0 .. 360 by mirroring at 270, then bring the first part behind.
        mirror(&mut columns, 270.0);
        for (angle, _) in &mut columns {
            *angle = if *angle > 360.0 + 1e-3 { *angle - 360.0 } else { *angle };
        }
        columns.sort_by(|a, b| a.0.total_cmp(&b.0));
        columns.dedup_by(|a, b| is_at(a.0, b.0));
        if let Some((angle, column)) = columns.last().cloned()
            && is_at(angle, 360.0)
        {
            columns.insert(0, (0.0, column));
        }
    } else {
        if is_at(first, 0.0) && is_at(last, 90.0) {
            mirror(&mut columns, 90.0);
        }
        if is_at(first, 0.0) && columns.last().is_some_and(|c| is_at(c.0, 180.0)) {
            mirror(&mut columns, 180.0);
        }
        // A whole circle that is not closed is.
        if let (Some((a, column)), Some((b, _))) = (columns.first().cloned(), columns.last())
            && *b < a + 360.0 - 1e-3
        {
            columns.push((a + 360.0, column));
        }
    }
    let (angles, values): (Vec<f32>, Vec<Vec<f32>>) = columns.into_iter().unzip();
    if !grows(&angles) {
        return Err(IesError::Order("horizontal"));
    }
    Ok((angles, values.concat()))
}
