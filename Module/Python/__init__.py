# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Legible semi-transparent data by moving light through it: VTK classes.

    from lighttransport import vtkOpticalMediumFilter, vtkLightSeedFilter
    from lighttransport import vtkLightDiffusionFilter, vtkLightTransportVolumeMapper

All public classes of the libraries are attributes of this package; they take
and give the objects of the system's vtkmodules.

Without a DISPLAY, importing this package makes a plain vtkRenderWindow render
through EGL (GPU or llvmpipe); with a DISPLAY nothing changes. Where OpenGL
cannot be loaded at all, the filters still work, and asking for a class that
renders says why it is missing.
"""

import importlib as _importlib

_rendering_error = None


def _take(name):
    """Puts the classes of one wrapped library into this package."""
    library = _importlib.import_module("." + name, __name__)
    names = [n for n in dir(library) if n.startswith("vtk")]
    for n in names:
        globals()[n] = getattr(library, n)
    return names


__all__ = _take("vtkLightTransportFilters")
try:
    # First VTK's own OpenGL classes: the factory's first registration wins, and
    # the headless window must come to know of it.
    import vtkmodules.vtkRenderingOpenGL2 as _opengl  # noqa: F401
    import vtkmodules.vtkRenderingVolumeOpenGL2 as _volumes  # noqa: F401
    import vtkmodules.vtkRenderingFreeType as _freetype  # noqa: F401

    __all__ += _take("vtkLightTransportRendering")
    __all__ += _take("vtkLightTransport")
except ImportError as error:
    _rendering_error = str(error)


def __getattr__(name):
    if name.startswith("vtk") and _rendering_error is not None:
        raise ImportError(
            f"lighttransport.{name} is not available: if it is one of the classes that render, "
            f"then because OpenGL could not be loaded ({_rendering_error})"
        )
    raise AttributeError(f"module 'lighttransport' has no attribute '{name}'")


def use_egl():
    """Makes every vtkRenderWindow that is created from now on render through EGL.

    For a process that has a DISPLAY and wants none; without a DISPLAY the import
    has done it. Returns whether EGL is there; where it is not, a render window
    tells so when it is asked to render.
    """
    window = globals().get("vtkLightTransportEGLRenderWindow")
    return window is not None and window.UseForAllWindows() and window.IsAvailable()


if _rendering_error is None:
    __version__ = globals()["vtkLightTransportVersion"].GetLightTransportVersion()
    globals()["vtkLightTransportEGLRenderWindow"].UseIfHeadless()
