"""Camera files of other programs, one format a file, and the one list of them."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from calibration.camera import Calibration
from calibration.formats import colmap, kalibr, mrcal, nerfstudio, ocamcalib, opencv
from calibration.formats.foreign import ForeignCamera
from calibration.formats.splined_stereographic import SplinedStereographic
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.ocam import OCam
from calibration.models.parameters import check_parameters
from capture.errors import InputError
from capture.files import read_bytes

_LIMIT_BYTES = 1 << 20


class Format(NamedTuple):
    """How a format is told, read and written.

    `read` takes the text and the name of one of its cameras, "" for the only one; it and `write`
    raise InputError without the name of the file. `nearest` is what a lens without a counterpart is
    approximated by.
    """

    recognises: Callable[[str], bool]
    read: Callable[[str, str], ForeignCamera]
    write: Callable[[Calibration], str]
    nearest: type[KannalaBrandt] | type[OCam] | type[SplinedStereographic]


FORMATS: dict[str, Format] = {
    "mrcal": Format(mrcal.recognises, mrcal.read, mrcal.write, SplinedStereographic),
    "ocamcalib": Format(ocamcalib.recognises, ocamcalib.read, ocamcalib.write, OCam),
    "nerfstudio": Format(nerfstudio.recognises, nerfstudio.read, nerfstudio.write, KannalaBrandt),
    "kalibr": Format(kalibr.recognises, kalibr.read, kalibr.write, KannalaBrandt),
    "opencv": Format(opencv.recognises, opencv.read, opencv.write, KannalaBrandt),
    "colmap": Format(colmap.recognises, colmap.read, colmap.write, KannalaBrandt),
}
"""Every format by its name, those that are told most surely first."""


def read_camera(path: Path, camera: str = "") -> tuple[str, ForeignCamera]:
    """Return the format of a file of another program, and the camera it holds.

    Raises
    ------
    InputError
        If the format is not known, the file holds several cameras and none is named, or its model
        has no exact counterpart here.
    """
    data = read_bytes(path, _LIMIT_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not text, as all camera files that can be read are") from None
    for name, known in FORMATS.items():
        if known.recognises(text):
            try:
                found = known.read(text, camera)
                check_parameters(found.model)
            except InputError as error:
                raise InputError(f"{path} ({name}): {error}") from None
            return name, found
    raise InputError(f"{path}: wanted a camera file of {', '.join(FORMATS)}; it is none of these")
