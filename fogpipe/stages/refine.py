"""Refinement of a transmission map, so that it follows the surfaces and not their texture."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Gt, Lt

from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import Transmission, Unit
from fogpipe.stage import stage


@stage("refine.bilateral")
def bilateral(
    transmission: Transmission,
    *,
    spatial_deviation: Annotated[float, Gt(0), Unit("px")] = 3.0,
    tonal_deviation: Annotated[float, Gt(0)] = 0.4,
    solver: Literal["fast", "exact"] = "fast",
    tolerance: Annotated[float, Gt(0), Lt(1)] = 0.002,
) -> Transmission:
    r"""Smooth a transmission inside surfaces and keep its edges, with the bilateral filter.

    .. math:: t(u) = \frac{\sum_p W_c(\|p - u\|)\, W_s(|t_0(u) - t_0(p)|)\, t_0(p)}
                          {\sum_p W_c(\|p - u\|)\, W_s(|t_0(u) - t_0(p)|)},
              \qquad W(x) = e^{-x^2 / 2\sigma^2}

    Parameters
    ----------
    transmission : (H, W) float, the initial transmission t₀. NaN where unknown.
    spatial_deviation : σc, pixels.
    tonal_deviation : σs, of a transmission in [0, 1].
    solver : ``"exact"``: the sum over a window of four deviations. ``"fast"``: Gaussian blurs of a few cosines of
        the transmission.
    tolerance : Root-mean-square error that the fast solver may have.

    Returns
    -------
    (H, W) float32, or float64 for float64 transmission, within the bounds of the transmission. Unknown stays NaN.

    Notes
    -----
    At the border of the image the window is cut off. The fast solver takes about 0.1 µs per pixel, the exact one 2 µs;
    the time of the fast one grows with σc and with 1/σs, of the exact one with σc². The error of the fast one is at
    most half the tolerance on noise, and a hundredth of it on photos; ``fogpipe bench photo`` measures both.

    References
    ----------
    Guo, Tang and Xiao 2014, *Foggy scene rendering based on transmission map estimation*, eq. 7; Chaudhury, Sage and
    Unser 2011, *Fast O(1) bilateral filtering using trigonometric range kernels*.
    """
    from fogpipe.kernels import bilateral as kernel

    require_maps(transmission=(transmission, 1))
    (initial,) = floats(transmission)
    if solver == "exact":
        return kernel.exact(initial, spatial_deviation, tonal_deviation)
    # Pure noise, the worst of maps, turns an error of the weights into one of 0.06 of it (root mean square).
    return kernel.fast(initial, spatial_deviation, tonal_deviation, min(0.2, 8 * tolerance))
