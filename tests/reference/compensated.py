# SPDX-License-Identifier: Apache-2.0
"""A rough metal that gives back what single scattering loses, for Mitsuba, whose own `roughconductor` does not. The
variant must be set before this is imported.

GGX with height-correlated Smith masking (E. Heitz, Understanding the Masking-Shadowing Function in Microfacet-Based
BRDFs, 2014; Mitsuba's is the product of both directions' masking, up to 2 % darker at grazing), and the lobe of Kulla
and Conty.

The lobe (C. Kulla and A. Conty, Revisiting Physically Based Shading at Imageworks, 2017) is F U(o) U(i) / (pi avg U), U
= 1 - E, E the directional albedo of the mirror of the same roughness, F = c^2 (1 - avg U) / (1 - c avg U) for a metal
of colour c at every angle. E is computed here, by quadrature over normals in f64, not taken from the renderer that is
judged.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

COSINES = 256
"""Entries of the table, equally far apart in the root of the cosine."""


def lost(alpha: float, cosine: np.ndarray, turns: int = 96, radii: int = 1024) -> np.ndarray:
    """U: what a GGX mirror with height-correlated Smith masking loses; normals are drawn with density D cos."""
    phi = np.pi * (np.arange(turns) + 0.5) / turns
    u = (np.arange(radii) + 0.5) / radii
    tangent = alpha * np.sqrt(u / (1 - u))
    hz = 1 / np.sqrt(1 + tangent**2)
    h = np.stack(
        [np.outer(np.cos(phi), tangent * hz), np.outer(np.sin(phi), tangent * hz), np.broadcast_to(hz, (turns, radii))]
    )
    lam = lambda c: 0.5 * (np.sqrt(1 + alpha**2 * (1 - c**2) / c**2) - 1)
    made = []
    for c in cosine:
        o = np.array([np.sqrt(1 - c * c), 0, c])
        half = np.tensordot(o, h, 1)
        iz = 2 * half * h[2] - c
        ok = (half > 0) & (iz > 0)
        g = 1 / (1 + lam(c) + lam(np.where(ok, iz, 1.0)))
        made.append(1 - np.where(ok, g * half / (c * h[2]), 0.0).mean())
    return np.maximum(np.array(made), 0.0)


class Compensated(mi.BSDF):
    """Parameters: `alpha`, `reflectance` (a colour)."""

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        alpha = float(props["alpha"])
        color = np.array([float(props[name]) for name in ("r", "g", "b")])
        self.alpha, self.color = alpha, mi.Color3f(color.tolist())
        self.normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)
        cosine = np.maximum(np.linspace(0, 1, COSINES) ** 2, 1e-4)
        table = lost(alpha, cosine)
        # The average over the hemisphere, cosine weighted, by a midpoint rule.
        c = (np.arange(2000) + 0.5) / 2000
        average = 2 * (np.interp(c**0.5, np.linspace(0, 1, COSINES), table) * c).mean()
        self.table = mi.Float(table.astype(np.float32))
        self.broad = mi.Color3f((color**2 * (1 - average) / (1 - color * average) / (np.pi * average)).tolist())
        self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
        self.m_components = [self.m_flags]

    def _lost(self, cosine):
        at = dr.sqrt(dr.clip(cosine, 0, 1)) * (COSINES - 1)
        low = mi.UInt32(dr.minimum(dr.floor(at), COSINES - 2))
        part = at - mi.Float(low)
        return dr.lerp(dr.gather(mi.Float, self.table, low), dr.gather(mi.Float, self.table, low + 1), part)

    def _slope(self, cosine):
        """1 + 2 Lambda, times the cosine."""
        return dr.sqrt(cosine**2 + self.alpha**2 * (1 - cosine**2))

    def eval(self, ctx, si, wo, active=True):
        above = (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        i, cosine = dr.maximum(mi.Frame3f.cos_theta(si.wi), 1e-6), dr.maximum(mi.Frame3f.cos_theta(wo), 0)
        # D G / (4 i): G = 1 / (1 + Lambda + Lambda').
        single = self.color * (
            self.normals.eval(dr.normalize(si.wi + wo))
            * cosine
            / (2 * (i * self._slope(cosine) + cosine * self._slope(i)))
        )
        back = self.broad * (self._lost(mi.Frame3f.cos_theta(si.wi)) * self._lost(cosine) * cosine)
        return dr.select(above, single + back, 0)

    def _pdf(self, wi, wo):
        h = dr.normalize(wi + wo)
        return self.normals.pdf(wi, h) / (4 * dr.maximum(dr.dot(wo, h), 1e-6))

    def pdf(self, ctx, si, wo, active=True):
        above = (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(above, 0.8 * self._pdf(si.wi, wo) + 0.2 * mi.warp.square_to_cosine_hemisphere_pdf(wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def sample(self, ctx, si, sample1, sample2, active=True):
        first = sample1 < 0.8
        h, _ = self.normals.sample(si.wi, sample2)
        sample = dr.zeros(mi.BSDFSample3f)
        sample.wo = dr.select(first, mi.reflect(si.wi, h), mi.warp.square_to_cosine_hemisphere(sample2))
        sample.pdf = self.pdf(ctx, si, sample.wo, active)
        sample.eta = 1.0
        sample.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        sample.sampled_component = 0
        ok = active & (sample.pdf > 0)
        return sample, dr.select(ok, self.eval(ctx, si, sample.wo, ok) / sample.pdf, 0)

    def to_string(self):
        return "Compensated[]"


mi.register_bsdf("compensated", Compensated)
