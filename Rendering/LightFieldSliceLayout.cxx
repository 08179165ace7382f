// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "LightFieldSliceLayout.h"

#include <algorithm>
#include <cmath>

namespace lighttransport
{
namespace
{
constexpr int Slices = 3;
constexpr int Gap = 2; // pixels, the background shows through

/** The largest scale at which something fits that grows with the scale. */
template <typename Fits>
double LargestScale(double upper, const Fits& fits)
{
  double low = 0.;
  double high = upper;
  for (int n = 0; n < 60; ++n)
  {
    const double middle = 0.5 * (low + high);
    (fits(middle) ? low : high) = middle;
  }
  return std::max(low, 1e-3 * upper); // a window of a few pixels shows something, too
}

double UpperScale(const LayoutNeeds& needs)
{
  double longest = 0.;
  for (const auto& length : needs.length)
  {
    longest = std::max({ longest, length[0], length[1] });
  }
  return std::max(needs.width, needs.height) / longest;
}
} // namespace

//------------------------------------------------------------------------------
LayoutPlan PlanRow(const LayoutNeeds& needs)
{
  const double available = needs.width - needs.legend - 2. * Gap;
  const auto widthOf = [&](int slice, double scale)
  { return std::max<double>(needs.least, scale * needs.length[slice][0]); };
  LayoutPlan plan;
  plan.scale = LargestScale(UpperScale(needs),
    [&](double scale)
    {
      double width = 0.;
      double height = 0.;
      for (int slice = 0; slice < Slices; ++slice)
      {
        width += widthOf(slice, scale);
        height = std::max(height, scale * needs.length[slice][1]);
      }
      return width <= available && height <= needs.height;
    });
  double rest = available;
  for (int slice = 0; slice < Slices; ++slice)
  {
    rest -= widthOf(slice, plan.scale);
  }
  double x = 0.;
  for (int slice = 0; slice < Slices; ++slice)
  {
    const double width = widthOf(slice, plan.scale) + std::max(0., rest) / Slices;
    const int left = static_cast<int>(std::lround(x));
    const int right = static_cast<int>(std::lround(x + width));
    plan.boxes[slice] = { left, 0, right - left, needs.height };
    x += width + Gap;
  }
  plan.boxes[3] = { needs.width - needs.legend, 0, needs.legend, needs.height };
  return plan;
}

//------------------------------------------------------------------------------
LayoutPlan PlanGrid(const LayoutNeeds& needs)
{
  const auto& length = needs.length;
  const double least = needs.least;
  const auto leftWidth = [&](double scale)
  { return std::max(least, scale * std::max(length[0][0], length[1][0])); };
  const auto rightWidth = [&](double scale) {
    return std::max({ least, scale * length[2][0], static_cast<double>(needs.legend) });
  };
  const auto topHeight = [&](double scale) { return std::max(least, scale * length[0][1]); };
  const auto bottomHeight = [&](double scale)
  { return std::max(least, scale * std::max(length[1][1], length[2][1])); };
  LayoutPlan plan;
  plan.scale = LargestScale(UpperScale(needs),
    [&](double scale)
    {
      return leftWidth(scale) + rightWidth(scale) + Gap <= needs.width &&
        topHeight(scale) + bottomHeight(scale) + Gap <= needs.height;
    });
  const double restX =
    std::max(0., needs.width - Gap - leftWidth(plan.scale) - rightWidth(plan.scale));
  const double restY =
    std::max(0., needs.height - Gap - topHeight(plan.scale) - bottomHeight(plan.scale));
  const int left = static_cast<int>(std::lround(leftWidth(plan.scale) + 0.5 * restX));
  const int bottom = static_cast<int>(std::lround(bottomHeight(plan.scale) + 0.5 * restY));
  const int x = left + Gap;
  const int y = bottom + Gap;
  plan.boxes[0] = { 0, y, left, needs.height - y };
  plan.boxes[1] = { 0, 0, left, bottom };
  plan.boxes[2] = { x, 0, needs.width - x, bottom };
  plan.boxes[3] = { x, y, needs.width - x, needs.height - y };
  return plan;
}
} // namespace lighttransport
