"""Renderer that leaves out what is not visible, with compiled code (scene.c, picture.c).

Rendering on a CPU takes time for each pixel and for each geom, visible or not. So geoms outside of
the image are not rendered. A background of one colour, the sky or the floor, is filled in when the
pixels are read; of such a floor only a piece is rendered, for its colour. All pixels stay the same.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.vision.renderer import Renderer
from kengoro_env.vision.simplified_scene import spooled

Image = NDArray[np.uint8]
Background = Literal["floor", "sky"]

_SKYBOX, _SKY = int(mujoco.mjtRndFlag.mjRND_SKYBOX), int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)
_PLANE, _ANY_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE), -1
_FILLED, _FIRST, _OPAQUE = 1, 2, 4  # flags of `prepare` in scene.c

# Constants of GL, from its header.
_RGBA, _UNSIGNED_BYTE = 0x1908, 0x1401
_FRAMEBUFFER, _RENDERBUFFER = 0x8D40, 0x8D41
_DEPTH_STENCIL_ATTACHMENT, _DEPTH_ATTACHMENT, _DEPTH_COMPONENT32F = 0x821A, 0x8D00, 0x8CAC

_INT, _UINT = ctypes.c_int, ctypes.c_uint
_PIECE = 2.0**-8
"""Part of a floor's width and length that is rendered for its colour. A power of two rounds
nothing, so that the colour stays the same."""


class Canvas(ctypes.Structure):
    """``Canvas`` of scene.c: where a scene is rendered to."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("width", "height")),
        *((name, ctypes.c_void_p) for name in ("geom", "camera", "light", "spooled")),
        *((name, ctypes.c_void_p) for name in ("vertex", "first_vertex", "vertex_count")),
        *(("pixel", ctypes.c_int64), ("point", ctypes.c_float * 3)),
    )


class QuickRenderer(Renderer):
    """A `mujoco.Renderer` for scenes without shadows, reflections, fog and back faces.

    Between `update_scene` and `render` geoms may be replaced by others in the same position, and
    geoms may be added. The first image with each background, and the first without, are rendered
    by `mujoco.Renderer` as well; if they differ, it renders all later images.

    Args:
        compiled: the compiled code, see `c_compiler.library`.
        model: the model.
        height: height of the images [pixels].
        width: width of the images [pixels].
        *args: further arguments of `mujoco.Renderer`.
    """

    def __init__(
        self, compiled: ctypes.CDLL, model: mujoco.MjModel, height: int, width: int, *args: Any
    ) -> None:
        super().__init__(model, height, width, *args)
        self._prepare, self._to_picture = _functions(compiled)
        self._read_pixels = _gl("glReadPixels", *[_INT] * 4, *[_UINT] * 2, ctypes.c_void_p)
        self._leave_out_stencil()
        # The value shows that pixels were read: no image is full of it.
        self._pixels = np.full((height, width), 0x63636363, dtype=np.uint32)
        # Skins and flexes are not geoms, and a texture with alpha shows what is behind.
        self._fills = not (model.nskin or model.nflex or 4 in model.tex_nchannel)
        self._differs, self._compared = False, set[Background | None]()
        self._sky = _colour_of_sky(model)
        self._counted = self._flags = 0
        self._spooled = spooled(model)  # the canvas points to it
        parts = (self.scene.geoms, self.scene.camera, self.scene.lights)
        meshes = (model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum)
        pointers = [each[0].pos.ctypes.data for each in parts]
        pointers += [each.ctypes.data for each in (self._spooled, *meshes)]
        self._canvas = Canvas(width, height, *pointers)

    def update_scene(self, data: mujoco.MjData, *args: Any) -> None:
        """Update the scene as `mujoco.Renderer` does, simplify it, leave out invisible geoms."""
        super().update_scene(data, *args)
        self._counted = self.scene.ngeom
        self._flags = self._prepare(self._canvas, self._counted, self.scene.nlight)

    def render(self, *, out: Image | None = None) -> Image:
        """Render an image (height, width, 3) uint8, or depths, as `mujoco.Renderer` does."""
        if out is not None or self._differs or self._depth_rendering:
            return np.asarray(super().render(out=out))
        if self._gl_context:
            self._gl_context.make_current()
        behind = self._behind()
        picture = self._render_before(behind)
        if behind in self._compared:
            return picture
        self._compared.add(behind)
        full = np.asarray(super().render())
        self._differs = not np.array_equal(picture, full)
        return full

    def _behind(self) -> Background | None:
        """The background to be filled in; None: all is rendered."""
        if not (self._fills and self._flags & _OPAQUE and self.scene.ngeom == self._counted):
            return None
        if not self._flags & _FILLED:
            return None if self._sky is None else "sky"
        return "floor" if self._flags & _FIRST else None

    def _render_before(self, behind: Background | None) -> Image:
        """Image with a background filled in; None: all is rendered."""
        if behind == "floor":
            with self._piece_of_floor():
                self._draw(sky=False)
        else:
            self._draw(sky=behind is None and not self._flags & _FILLED)
        pixels = self._pixels.ctypes.data
        self._read_pixels(0, 0, self.width, self.height, _RGBA, _UNSIGNED_BYTE, pixels)
        colour = self._colour(behind)
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        self._to_picture(
            *(pixels, self.width, self.height, behind is not None, colour, picture.ctypes.data)
        )
        return picture

    @contextmanager
    def _piece_of_floor(self) -> Iterator[None]:
        """Replace the floor by a piece of it where no other geom is seen."""
        floor = self.scene.geoms[0]
        before = floor.type, floor.dataid, floor.pos.copy(), floor.size.copy()
        floor.type, floor.dataid = _PLANE, _ANY_PLANE
        floor.pos[:] = self._canvas.point
        floor.size[:2] *= _PIECE
        yield
        floor.type, floor.dataid, floor.pos[:], floor.size[:] = before

    def _colour(self, behind: Background | None) -> int:
        """Colour of a background, as a pixel."""
        if behind == "floor":
            return int(self._pixels.ravel()[self._canvas.pixel]) & 0xFFFFFF
        return self._sky or 0

    def _leave_out_stencil(self) -> None:
        """Replace the buffer of depth and stencil by one of depth; reflections need the stencil."""
        buffer = _UINT()
        _gl("glGenRenderbuffers", _INT, ctypes.c_void_p)(1, ctypes.addressof(buffer))
        _gl("glBindRenderbuffer", _UINT, _UINT)(_RENDERBUFFER, buffer)
        store = _gl("glRenderbufferStorage", _UINT, _UINT, _INT, _INT)
        store(_RENDERBUFFER, _DEPTH_COMPONENT32F, self.width, self.height)
        _gl("glBindFramebuffer", _UINT, _UINT)(_FRAMEBUFFER, self._mjr_context.offFBO)
        attach = _gl("glFramebufferRenderbuffer", _UINT, _UINT, _UINT, _UINT)
        attach(_FRAMEBUFFER, _DEPTH_STENCIL_ATTACHMENT, _RENDERBUFFER, 0)
        attach(_FRAMEBUFFER, _DEPTH_ATTACHMENT, _RENDERBUFFER, buffer)

    def _draw(self, sky: bool) -> None:
        self.scene.flags[_SKYBOX] = sky
        mujoco.mjr_render(self._rect, self.scene, self._mjr_context)
        self.scene.flags[_SKYBOX] = True


def _functions(compiled: ctypes.CDLL) -> tuple[Callable[..., int], Callable[..., None]]:
    """`prepare` of scene.c and `to_picture` of picture.c."""
    pointer, number = ctypes.c_void_p, ctypes.c_int64
    prepare = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(Canvas), number, number)
    to_picture = ctypes.CFUNCTYPE(
        None, pointer, number, number, ctypes.c_int, ctypes.c_uint32, pointer
    )
    return prepare(("prepare", compiled)), to_picture(("to_picture", compiled))


def _gl(name: str, *arguments: type) -> Callable[..., None]:
    """A function of the GL library in use; PyOpenGL's own module of functions loads slowly."""
    from OpenGL.platform import PLATFORM

    return ctypes.CFUNCTYPE(None, *arguments)((name, PLATFORM.GL))


def _colour_of_sky(model: mujoco.MjModel) -> int | None:
    """Colour of a model's sky, as a pixel; black without a sky, None for several colours."""
    skies = [model.texture(int(i)) for i in np.flatnonzero(model.tex_type == _SKY)]
    if not skies:
        return _as_pixel(np.zeros(3))
    if len(skies) > 1 or skies[0].nchannel[0] != 3:
        return None
    begin, count = int(skies[0].adr[0]), int(skies[0].width[0]) * int(skies[0].height[0])
    colours = model.tex_data[begin : begin + 3 * count].reshape(count, 3)
    return _as_pixel(colours[0]) if (colours == colours[0]).all() else None


def _as_pixel(colour: NDArray[Any]) -> int:
    """Red, green and blue [0, 255] as a pixel, in the order of GL's bytes."""
    red, green, blue = colour.tolist()
    return int(red) | int(green) << 8 | int(blue) << 16
