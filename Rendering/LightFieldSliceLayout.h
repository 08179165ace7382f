// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Where three slices and a legend go in a rectangle of pixels, all slices at one
 * scale. Private to vtkLightFieldSlices; pure functions.
 */
#ifndef LightFieldSliceLayout_h
#define LightFieldSliceLayout_h

namespace lighttransport
{
/** A rectangle of the window in pixels. */
struct Box
{
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

/** Where the three slices and the legend go, at which scale (pixels per world length). */
struct LayoutPlan
{
  double scale = 0.;
  Box boxes[4]; // axial, coronal, sagittal, legend
};

/** What a layout is planned for. */
struct LayoutNeeds
{
  int width = 0;
  int height = 0;
  int legend = 0;           // its width in pixels, or 0
  int least = 1;            // no slice's box is smaller
  double length[3][2] = {}; // of each slice in the world: horizontal, vertical
};

/** The slices side by side, the legend to their right. */
LayoutPlan PlanRow(const LayoutNeeds& needs);

/** Coronal below axial, sagittal to its right, the legend in the free corner. */
LayoutPlan PlanGrid(const LayoutNeeds& needs);
} // namespace lighttransport

#endif
