// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The colour legend of a light field: a bar, or one upwards for positive and one
 * downwards for negative values, with decades (or round numbers) as labels.
 * Private to vtkLightFieldSlices; geometry and text only, in pixels.
 */
#ifndef LightFieldLegend_h
#define LightFieldLegend_h

#include "LightFieldSliceImage.h"

#include <string>
#include <vector>

class vtkPolyData;

namespace lighttransport
{
struct LegendLabel
{
  std::string text;
  double x = 0.;
  double y = 0.;
  bool isTitle = false; // vertical, to be read from the right; else centred in height at (x, y)
};

struct Legend
{
  std::vector<LegendLabel> labels;
};

/** A label, and where on the window's scale (t in [0,1]) it belongs. */
struct Tick
{
  std::string text;
  double t = 0.;
};

/** Powers of ten in [lo, hi], thinned to at most the given number; the ends if there are none. */
std::vector<Tick> LogarithmicTicks(double lo, double hi, int most);

/** Round numbers in [lo, hi] at steps of 1, 2 or 5 times a power of ten. */
std::vector<Tick> LinearTicks(double lo, double hi, int most);

/** The width in pixels that a legend needs: the flux's has three columns. */
int LegendWidth(int fontSize, bool isFlux);

/**
 * The bars as coloured cells with ticks, in pixels of a viewport of the given size;
 * text to go with it. The tables of the look must be filled.
 */
Legend MakeLegend(vtkPolyData* bars, const LightLook& look, bool hasPositive, bool hasNegative,
  const std::string& title, const std::string directionNames[3], int width, int height,
  int fontSize);
} // namespace lighttransport

#endif
