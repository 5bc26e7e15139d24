"""Sigmas and tables of an observation."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional

import numpy as np

from . import _lapservo as _core  # type: ignore[attr-defined]


class Sigmas(NamedTuple):
    """One standard deviation of each number of an observation; None where the number is unknown."""

    theta: Optional[float]  # rad
    phi: Optional[float]  # rad
    rho: Optional[float]  # m
    psi: Optional[float]  # rad
    tau: Optional[float]  # rad
    s: Optional[float]  # rad
    r: Optional[float]  # px
    l: Optional[float]  # px
    d: Optional[float]  # px


def _sigma(seen: Any) -> Sigmas:
    """Sigmas: one standard deviation of each number, `seen.sigma.psi` for example; None where it is unknown."""
    q, features = (_roots(covariance) for covariance in (seen.q_covariance, seen.features_covariance))
    return Sigmas._make([*q, seen.sigma_tau_rad, *features])


def _roots(covariance: Any) -> list[Optional[float]]:
    if covariance is None:
        return [None] * 4
    return [None if np.isnan(variance) else float(np.sqrt(variance)) for variance in np.diag(covariance)]


_core.Observation.sigma = property(_sigma)
