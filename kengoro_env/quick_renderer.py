"""A renderer that draws nothing that nobody sees, by compiled code (picture.c).

A CPU that draws takes long for what fills a picture, and for each thing that it is given, seen or
not. So what is outside of the picture is not drawn, and a background of one colour, be it the floor
or the sky, is filled in when pixels are read. Not a pixel changes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

_SKYBOX, _SKY = int(mujoco.mjtRndFlag.mjRND_SKYBOX), int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)
_NONE = int(mujoco.mjtGeom.mjGEOM_NONE)
_FILLED, _FIRST, _OPAQUE = 1, 2, 4  # what `leave_out` of picture.c says

# Of GL, in whose own header they are found.
_RGBA, _UNSIGNED_BYTE = 0x1908, 0x1401
_FRAMEBUFFER, _RENDERBUFFER = 0x8D40, 0x8D41
_DEPTH_STENCIL_ATTACHMENT, _DEPTH_ATTACHMENT, _DEPTH_COMPONENT32F = 0x821A, 0x8D00, 0x8CAC

_INT, _UINT = ctypes.c_int, ctypes.c_uint
_FEW = 16
"""How many pixels wide the picture is that shows whether a floor has one colour."""


class QuickRenderer(mujoco.Renderer):
    """A `mujoco.Renderer` of scenes without shadows and reflections.

    Between `update_scene` and `render` geoms may be replaced by others in the same place, and some
    be added. The first picture with a background that was filled in, and the first without, are
    drawn by `mujoco.Renderer`, too; should they differ, it draws all others.

    Args:
        compiled: the code, of `compiling.library`.
        model, height, width, ...: as of `mujoco.Renderer`.
    """

    def __init__(
        self, compiled: ctypes.CDLL, model: mujoco.MjModel, height: int, width: int, *args: Any
    ) -> None:
        super().__init__(model, height, width, *args)
        self._leave_out, self._to_picture = _functions(compiled)
        self._read_pixels = _gl("glReadPixels", *[_INT] * 4, *[_UINT] * 2, ctypes.c_void_p)
        self._leave_out_stencil()
        self._pixels = np.full((height, width, 4), 99, dtype=np.uint8)  # which is no empty picture
        few = min(_FEW, width)
        self._small = mujoco.MjrRect(0, 0, few, max(few * height // width, 1))
        self._sample = np.zeros((self._small.height, self._small.width, 3), dtype=np.uint8)
        # Skins and flexes are no geoms, and a texture's alpha shows what is behind.
        self._fills = not (model.nskin or model.nflex or 4 in model.tex_nchannel)
        self._differs, self._compared = False, set[bool]()
        self._sky = _colour_of_sky(model)
        self._counted = self._said = 0

    def update_scene(self, data: mujoco.MjData, *args: Any) -> None:
        """As of `mujoco.Renderer`, without geoms that are outside of the picture."""
        super().update_scene(data, *args)
        scene, aspect = self.scene, self.width / self.height
        first, eyes = scene.geoms[0].pos, scene.camera[0].pos
        self._counted = scene.ngeom
        self._said = self._leave_out(first.ctypes.data, scene.ngeom, eyes.ctypes.data, aspect)

    def render(self, *, out: Image | None = None) -> Image:
        """As of `mujoco.Renderer`: (height, width, 3) uint8."""
        if out is not None or self._differs:
            return np.asarray(super().render(out=out))
        if self._gl_context:
            self._gl_context.make_current()
        background = self._background()
        picture = self._picture(background)
        kind = background is not None
        if kind in self._compared:
            return picture
        self._compared.add(kind)
        full = np.asarray(super().render())
        self._differs = not np.array_equal(picture, full)
        return full

    def _background(self) -> int | None:
        """The colour that is filled in, as a pixel; None: everything is drawn."""
        if not (self._fills and self._said & _OPAQUE and self.scene.ngeom == self._counted):
            return None
        if not self._said & _FILLED:
            return self._sky
        return self._colour_of_first() if self._said & _FIRST else None

    def _colour_of_first(self) -> int | None:
        """The one colour of the first geom, which fills the picture; None if there are more."""
        scene, count = self.scene, self.scene.ngeom
        scene.ngeom = 1
        self._draw(self._small, sky=False)
        scene.ngeom = count
        mujoco.mjr_readPixels(self._sample, None, self._small, self._mjr_context)
        colour = self._sample[0, 0]
        return _as_pixel(colour) if (self._sample == colour).all() else None

    def _picture(self, background: int | None) -> Image:
        """What is seen before a colour, or drawn all."""
        filled, floor = bool(self._said & _FILLED), self.scene.geoms[0]
        kind = floor.type
        if background is not None and filled:
            floor.type = _NONE
        self._draw(self._rect, sky=background is None and not filled)
        floor.type = kind
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        pixels = self._pixels.ctypes.data
        self._read_pixels(0, 0, self.width, self.height, _RGBA, _UNSIGNED_BYTE, pixels)
        self._to_picture(
            *(pixels, self.width, self.height),
            *(background is not None, background or 0, picture.ctypes.data),
        )
        return picture

    def _leave_out_stencil(self) -> None:
        """Measure depth in half the memory: beside it is a stencil, for reflections only."""
        buffer = _UINT()
        _gl("glGenRenderbuffers", _INT, ctypes.c_void_p)(1, ctypes.addressof(buffer))
        _gl("glBindRenderbuffer", _UINT, _UINT)(_RENDERBUFFER, buffer)
        store = _gl("glRenderbufferStorage", _UINT, _UINT, _INT, _INT)
        store(_RENDERBUFFER, _DEPTH_COMPONENT32F, self.width, self.height)
        _gl("glBindFramebuffer", _UINT, _UINT)(_FRAMEBUFFER, self._mjr_context.offFBO)
        attach = _gl("glFramebufferRenderbuffer", _UINT, _UINT, _UINT, _UINT)
        attach(_FRAMEBUFFER, _DEPTH_STENCIL_ATTACHMENT, _RENDERBUFFER, 0)
        attach(_FRAMEBUFFER, _DEPTH_ATTACHMENT, _RENDERBUFFER, buffer)

    def _draw(self, where: mujoco.MjrRect, sky: bool) -> None:
        self.scene.flags[_SKYBOX] = sky
        mujoco.mjr_render(where, self.scene, self._mjr_context)
        self.scene.flags[_SKYBOX] = True


def _functions(compiled: ctypes.CDLL) -> tuple[Callable[..., int], Callable[..., None]]:
    """`leave_out` and `to_picture` of picture.c."""
    pointer, number = ctypes.c_void_p, ctypes.c_int64
    leave_out = ctypes.CFUNCTYPE(ctypes.c_int, pointer, number, pointer, ctypes.c_double)
    to_picture = ctypes.CFUNCTYPE(
        None, pointer, number, number, ctypes.c_int, ctypes.c_uint32, pointer
    )
    return leave_out(("leave_out", compiled)), to_picture(("to_picture", compiled))


def _gl(name: str, *arguments: type) -> Callable[..., None]:
    """A function of the GL library that draws; PyOpenGL's own module of them loads slowly."""
    from OpenGL.platform import PLATFORM

    return ctypes.CFUNCTYPE(None, *arguments)((name, PLATFORM.GL))


def _colour_of_sky(model: mujoco.MjModel) -> int | None:
    """The one colour of a model's sky, as a pixel, black without a sky; None if there are more."""
    skies = [model.texture(int(i)) for i in np.flatnonzero(model.tex_type == _SKY)]
    if not skies:
        return _as_pixel(np.zeros(3))
    if len(skies) > 1 or skies[0].nchannel[0] != 3:
        return None
    begin, count = int(skies[0].adr[0]), int(skies[0].width[0]) * int(skies[0].height[0])
    colours = model.tex_data[begin : begin + 3 * count].reshape(count, 3)
    return _as_pixel(colours[0]) if (colours == colours[0]).all() else None


def _as_pixel(colour: NDArray[Any]) -> int:
    """Red, green, blue [0, 255] in the order of GL's bytes."""
    red, green, blue = colour.tolist()
    return int(red) | int(green) << 8 | int(blue) << 16
