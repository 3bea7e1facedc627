"""Camera models, one a file: each maps directions to pixels and back, past 90° too."""

from calibration.camera import CameraModel
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equidistant import Equidistant
from calibration.models.equirectangular import Equirectangular
from calibration.models.equisolid import Equisolid
from calibration.models.extended_unified import ExtendedUnified
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.mirror_ball_off_axis import MirrorBallOffAxis
from calibration.models.ocam import OCam
from calibration.models.orthographic import Orthographic
from calibration.models.splined_radial import SplinedRadial
from calibration.models.stereographic import Stereographic
from calibration.models.unified import Unified

MODELS: dict[str, type[CameraModel]] = {
    model.name: model
    for model in (
        Equidistant,
        Equisolid,
        Stereographic,
        Orthographic,
        KannalaBrandt,
        OCam,
        Unified,
        ExtendedUnified,
        DoubleSphere,
        SplinedRadial,
        MirrorBall,
        MirrorBallOffAxis,
        Equirectangular,
    )
}
"""Every camera model by its name in a calibration file."""
