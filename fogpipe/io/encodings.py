"""How depth is written as numbers in a file: one table of named encodings.

A file never says what its numbers mean: 16-bit codes of KITTI, of a Kinect and of Cityscapes look alike. So an
encoding is always named by the user, and never guessed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fogpipe.errors import InputError, did_you_mean

Quantity = Literal["planar", "radial", "disparity", "relative"]
WHOLE = ("png", "npy", "npz")
REAL = ("npy", "npz", "pfm", "exr")


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthEncoding:
    """One way to write depth as numbers. A number v of the file means ``(v − offset) / divisor``.

    Attributes
    ----------
    name : what the user writes, as in ``--depth kitti``.
    meaning : one line for people.
    quantity : ``planar`` (along the optical axis) or ``radial`` (along the ray), both in metres;
        ``disparity`` (px, left camera); ``relative`` (0 near, 1 far, no unit).
    files : formats of file it may be stored in: png, npy, npz, pfm, exr.
    whole : whether the file holds whole-number codes (True) or real numbers (False).
    divisor, offset : the formula above.
    rotated : whether the 16 bits of a code are rotated left by 3, as SUN RGB-D does.
    unknown : the number that means "not measured", or None. NaN always means it.
    sky : the number from which on the pixel is sky, infinitely far, or None. +inf always means it,
        unless ``unknown`` is +inf.
    background : the number that a renderer leaves where nothing was hit, which is sky as well, or None.
    needs : what the camera file must hold beyond the intrinsic matrix, ``()`` if none is needed.
    source : where the convention is laid down.
    """

    name: str
    meaning: str
    quantity: Quantity
    files: tuple[str, ...]
    whole: bool
    divisor: float = 1
    offset: float = 0
    rotated: bool = False
    unknown: float | None = None
    sky: float | None = None
    background: float | None = None
    needs: tuple[str, ...] = ()
    source: str = "fogpipe"

    @property
    def formula(self) -> str:
        """The formula in words, such as ``Z = v/256 m``."""
        value = "(v>>3 | v<<13)" if self.rotated else f"(v − {self.offset:g})" if self.offset else "v"
        value += f"/{self.divisor:g}" if self.divisor != 1 else ""
        offset = " + doffs" if "doffs" in self.needs else ""
        return {
            "planar": f"Z = {value} m",
            "radial": f"range = {value} m",
            "disparity": f"Z = baseline·fx/({value}{offset}) m",
            "relative": f"relative depth = {value}",
        }[self.quantity]

    @property
    def codes(self) -> str:
        """What marks unknown and sky, in words."""
        marks = []
        if self.unknown is not None:
            marks.append(f"{self.unknown:g} unknown")
        elif not self.whole:
            marks.append("NaN unknown")
        if self.background is not None:
            marks.append(f"{self.background:g} sky")
        if self.sky is not None:
            marks.append(f"{self.sky:g} and more sky")
        elif self.whole and self.quantity == "disparity":
            marks.append(f"{self.offset:g} sky")
        elif not self.whole and self.unknown != float("inf") and self.quantity != "relative":
            marks.append("inf sky")
        return ", ".join(marks) or "none"


_TABLE = (
    DepthEncoding(
        name="kitti",
        meaning="KITTI depth and depth completion (lidar)",
        quantity="planar",
        files=WHOLE,
        whole=True,
        divisor=256,
        unknown=0,
        source="KITTI depth development kit (Uhrig 2017)",
    ),
    DepthEncoding(
        name="cityscapes",
        meaning="Cityscapes stereo disparity",
        quantity="disparity",
        files=WHOLE,
        whole=True,
        divisor=256,
        offset=1,
        unknown=0,
        needs=("baseline",),
        source="Cityscapes scripts, README (Cordts 2016)",
    ),
    DepthEncoding(
        name="middlebury",
        meaning="Middlebury 2014 stereo disparity",
        quantity="disparity",
        files=("pfm", "npy"),
        whole=False,
        unknown=float("inf"),
        needs=("baseline", "doffs"),
        source="Middlebury stereo data sets 2014 (Scharstein 2014)",
    ),
    DepthEncoding(
        name="millimetres",
        meaning="Kinect, RealSense, NYU and ScanNet: millimetres",
        quantity="planar",
        files=WHOLE,
        whole=True,
        divisor=1000,
        unknown=0,
        source="OpenNI and Kinect drivers",
    ),
    DepthEncoding(
        name="tum",
        meaning="TUM RGB-D",
        quantity="planar",
        files=WHOLE,
        whole=True,
        divisor=5000,
        unknown=0,
        source="TUM RGB-D benchmark, file formats (Sturm 2012)",
    ),
    DepthEncoding(
        name="sun",
        meaning="SUN RGB-D: millimetres with rotated bits",
        quantity="planar",
        files=WHOLE,
        whole=True,
        divisor=1000,
        rotated=True,
        unknown=0,
        source="SUN RGB-D toolbox, read3dPoints (Song 2015)",
    ),
    DepthEncoding(
        name="virtual-kitti-2",
        meaning="Virtual KITTI 2: centimetres up to 655.34 m",
        quantity="planar",
        files=WHOLE,
        whole=True,
        divisor=100,
        sky=65535,
        source="Virtual KITTI 2 (Cabon 2020)",
    ),
    DepthEncoding(
        name="tartanair",
        # The data set has no sky code: its sky sphere is "a large distance (e.g. 10000)", which depends on the scene.
        meaning="TartanAir: metres, the sky a far sphere (taken as sky from 5 km on)",
        quantity="planar",
        files=("npy", "npz"),
        whole=False,
        sky=5000,
        source="TartanAir tools, data types (Wang 2020)",
    ),
    DepthEncoding(
        name="hypersim",
        meaning="Hypersim depth_meters (HDF5 saved as .npy or .npz): metres along the ray",
        quantity="radial",
        files=("npy", "npz"),
        whole=False,
        source="Hypersim README (Roberts 2021)",
    ),
    DepthEncoding(
        name="exr-z",
        meaning="Z of a renderer, scene units taken as metres, 0 where nothing was hit",
        quantity="planar",
        files=("exr",),
        whole=False,
        background=0,
        sky=1e9,  # Blender writes 1e10 where a ray hits nothing.
        source="OpenEXR, technical introduction (channel Z)",
    ),
    DepthEncoding(name="metres", meaning="planar depth in metres", quantity="planar", files=REAL, whole=False),
    DepthEncoding(
        name="metres-zero-unknown",
        meaning="planar depth in metres, 0 where nothing was measured",
        quantity="planar",
        files=REAL,
        whole=False,
        unknown=0,
    ),
    DepthEncoding(
        name="metres-radial", meaning="distance along the ray in metres", quantity="radial", files=REAL, whole=False
    ),
    DepthEncoding(
        name="relative", meaning="0 near to 1 far, without unit", quantity="relative", files=REAL, whole=False
    ),
    DepthEncoding(
        name="relative-16bit",
        meaning="black near to white far, without unit",
        quantity="relative",
        files=("png",),
        whole=True,
        divisor=65535,
    ),
)

ENCODINGS = {encoding.name: encoding for encoding in _TABLE}
"""Every depth encoding by name."""


def encoding_named(name: str) -> DepthEncoding:
    """The encoding of that name.

    Raises
    ------
    InputError
        If there is none; the message lists all.
    """
    if name not in ENCODINGS:
        raise InputError(f'no depth encoding "{name}".{did_you_mean(name, ENCODINGS)} Known:\n{encodings_text()}')
    return ENCODINGS[name]


def encodings_text(file_format: str | None = None) -> str:
    """A line for each encoding, or for each that a file of this format may have."""
    fitting = [e for e in _TABLE if file_format is None or file_format in e.files]
    return "\n".join(f"  {e.name:<20} {e.meaning}: {e.formula}; {e.codes}" for e in fitting)
