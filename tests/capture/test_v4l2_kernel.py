"""The structures' sizes and the request numbers, against what the kernel's own header gives."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest

from capture.v4l2 import kernel

REQUESTS = {  # as a C compiler computes them from linux/videodev2.h on x86-64
    "VIDIOC_QUERYCAP": (kernel.QUERY_CAPABILITY, 0x80685600),
    "VIDIOC_ENUM_FMT": (kernel.ENUMERATE_FORMATS, 0xC0405602),
    "VIDIOC_G_FMT": (kernel.GET_FORMAT, 0xC0D05604),
    "VIDIOC_S_FMT": (kernel.SET_FORMAT, 0xC0D05605),
    "VIDIOC_REQBUFS": (kernel.REQUEST_BUFFERS, 0xC0145608),
    "VIDIOC_QUERYBUF": (kernel.QUERY_BUFFER, 0xC0585609),
    "VIDIOC_QBUF": (kernel.QUEUE_BUFFER, 0xC058560F),
    "VIDIOC_DQBUF": (kernel.DEQUEUE_BUFFER, 0xC0585611),
    "VIDIOC_STREAMON": (kernel.STREAM_ON, 0x40045612),
    "VIDIOC_STREAMOFF": (kernel.STREAM_OFF, 0x40045613),
    "VIDIOC_G_PARM": (kernel.GET_PARAMETERS, 0xC0CC5615),
    "VIDIOC_S_PARM": (kernel.SET_PARAMETERS, 0xC0CC5616),
    "VIDIOC_QUERYMENU": (kernel.QUERY_MENU, 0xC02C5625),
    "VIDIOC_G_EXT_CTRLS": (kernel.GET_CONTROLS, 0xC0205647),
    "VIDIOC_S_EXT_CTRLS": (kernel.SET_CONTROLS, 0xC0205648),
    "VIDIOC_ENUM_FRAMESIZES": (kernel.ENUMERATE_SIZES, 0xC02C564A),
    "VIDIOC_ENUM_FRAMEINTERVALS": (kernel.ENUMERATE_INTERVALS, 0xC034564B),
    "VIDIOC_QUERY_EXT_CTRL": (kernel.QUERY_CONTROL, 0xC0E85667),
}

OFFSETS = {  # of the members that lie behind padding, unions and packing
    ("v4l2_format", "fmt.pix.width"): kernel.Format.width,
    ("v4l2_format", "fmt.pix.ycbcr_enc"): kernel.Format.ycbcr_enc,
    ("v4l2_format", "fmt.pix.xfer_func"): kernel.Format.xfer_func,
    ("v4l2_streamparm", "parm.capture.timeperframe"): kernel.StreamParameters.numerator,
    ("v4l2_frmsizeenum", "discrete"): kernel.FrameSize.values,
    ("v4l2_frmivalenum", "discrete"): kernel.FrameInterval.values,
    ("v4l2_buffer", "timestamp"): kernel.Buffer.seconds,
    ("v4l2_buffer", "sequence"): kernel.Buffer.sequence,
    ("v4l2_buffer", "m"): kernel.Buffer.offset,
    ("v4l2_buffer", "length"): kernel.Buffer.length,
    ("v4l2_query_ext_ctrl", "minimum"): kernel.ControlQuery.minimum,
    ("v4l2_query_ext_ctrl", "flags"): kernel.ControlQuery.flags,
    ("v4l2_querymenu", "name"): kernel.MenuQuery.name,
    ("v4l2_ext_control", "value64"): kernel.ControlValue.value64,
    ("v4l2_ext_controls", "controls"): kernel.ControlValues.controls,
}


@pytest.mark.parametrize("name", REQUESTS)
def test_a_request_number_which_holds_the_structures_size_is_the_kernels(name: str) -> None:
    ours, kernels = REQUESTS[name]
    assert ours == kernels


def test_members_lie_where_the_header_has_them(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None or not Path("/usr/include/linux/videodev2.h").exists():
        pytest.skip("no C compiler, or no kernel headers (apt-get install linux-libc-dev)")
    places = "".join(f'printf("%zu\\n", offsetof(struct {s}, {m}));' for s, m in OFFSETS)
    source = tmp_path / "offsets.c"
    source.write_text(
        "#include <linux/videodev2.h>\n#include <stddef.h>\n#include <stdio.h>\n"
        f"int main(void) {{ {places} return 0; }}"
    )
    subprocess.run([compiler, "-o", tmp_path / "offsets", source], check=True)
    output = subprocess.run([tmp_path / "offsets"], check=True, capture_output=True, text=True)
    assert [field.offset for field in OFFSETS.values()] == [int(x) for x in output.stdout.split()]


@pytest.mark.parametrize(("name", "number"), [("YUYV", 0x56595559), ("Y16", 0x20363159)])
def test_a_fourcc_is_little_endian_and_padded_with_spaces(name: str, number: int) -> None:
    assert kernel.fourcc(name) == number
    assert kernel.fourcc_name(number) == name


def test_buffers_hold_64_bit_times() -> None:
    assert ctypes.sizeof(kernel.Buffer) == 88
    assert kernel.Buffer.seconds.size == 8
