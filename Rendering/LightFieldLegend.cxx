// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "LightFieldLegend.h"

#include "vtkCellArray.h"
#include "vtkLightFieldProperty.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace lighttransport
{
namespace
{
std::string Text(double value)
{
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  // "1e-05" is read as "1e-5".
  std::string shorter = text;
  const std::size_t e = shorter.find('e');
  if (e != std::string::npos && e + 2 < shorter.size() && shorter[e + 2] == '0')
  {
    shorter.erase(e + 2, 1);
  }
  if (e != std::string::npos && shorter[e + 1] == '+')
  {
    shorter.erase(e + 1, 1);
  }
  return shorter;
}

/** Coloured rectangles and lines. */
class Drawing
{
public:
  void Quad(double x0, double y0, double x1, double y1, const double* low, const double* high)
  {
    const vtkIdType ids[4] = { this->Point(x0, y0, low), this->Point(x1, y0, low),
      this->Point(x1, y1, high), this->Point(x0, y1, high) };
    this->Quads->InsertNextCell(4, ids);
  }
  void Line(double x0, double y0, double x1, double y1)
  {
    const double grey[3] = { .8, .8, .8 };
    const vtkIdType ids[2] = { this->Point(x0, y0, grey), this->Point(x1, y1, grey) };
    this->Lines->InsertNextCell(2, ids);
  }
  void Frame(double x0, double y0, double x1, double y1)
  {
    this->Line(x0, y0, x1, y0);
    this->Line(x1, y0, x1, y1);
    this->Line(x1, y1, x0, y1);
    this->Line(x0, y1, x0, y0);
  }
  void Finish(vtkPolyData* output)
  {
    output->Initialize();
    output->SetPoints(this->Points);
    output->SetPolys(this->Quads);
    output->SetLines(this->Lines);
    output->GetPointData()->SetScalars(this->Colors);
  }
  Drawing() { this->Colors->SetNumberOfComponents(3); }

private:
  vtkIdType Point(double x, double y, const double* color)
  {
    for (int c = 0; c < 3; ++c)
    {
      this->Colors->InsertNextValue(
        static_cast<unsigned char>(std::lround(255. * std::min(1., std::max(0., color[c])))));
    }
    return this->Points->InsertNextPoint(x, y, 0.);
  }
  vtkNew<vtkPoints> Points;
  vtkNew<vtkCellArray> Quads;
  vtkNew<vtkCellArray> Lines;
  vtkNew<vtkUnsignedCharArray> Colors;
};

/** The colour that a bar shows at t: what lit air looks like, opacity left out. */
void BarColor(const LightLook& look, double t, bool isNegative, int column, double rgb[3])
{
  if (look.mode == vtkLightFieldProperty::FluxDirection)
  {
    for (int c = 0; c < 3; ++c)
    {
      rgb[c] = c == column ? t : 0.;
    }
    return;
  }
  std::copy_n(look.At(t, isNegative), 3, rgb);
}
} // namespace

//------------------------------------------------------------------------------
std::vector<Tick> LogarithmicTicks(double lo, double hi, int most)
{
  std::vector<Tick> ticks;
  const int first = static_cast<int>(std::ceil(std::log10(lo) - 1e-9));
  const int last = static_cast<int>(std::floor(std::log10(hi) + 1e-9));
  const double range = std::log(hi / lo);
  if (last > first)
  {
    const int step = std::max(1,
      (last - first) / std::max(1, most - 1) +
        ((last - first) % std::max(1, most - 1) != 0 ? 1 : 0));
    // One way of writing for all: 0.01 0.1 1 10, or 1e-4 1e-3 1e-2.
    const bool isPlain = first >= -2 && last <= 3;
    for (int decade = last; decade >= first; decade -= step)
    {
      const double value = std::pow(10., decade);
      const double t = std::log(value / lo) / range;
      ticks.push_back(
        { isPlain ? Text(value) : "1e" + std::to_string(decade), std::min(1., std::max(0., t)) });
    }
    std::reverse(ticks.begin(), ticks.end());
    return ticks;
  }
  return { { Text(lo), 0. }, { Text(hi), 1. } };
}

//------------------------------------------------------------------------------
std::vector<Tick> LinearTicks(double lo, double hi, int most)
{
  std::vector<Tick> ticks;
  const double rough = (hi - lo) / std::max(1, most - 1);
  const double power = std::pow(10., std::floor(std::log10(rough)));
  double step = 10. * power;
  for (const double factor : { 1., 2., 5. })
  {
    if (factor * power >= rough * (1. - 1e-9))
    {
      step = factor * power;
      break;
    }
  }
  for (double n = std::ceil(lo / step - 1e-9); n * step <= hi * (1. + 1e-9); n += 1.)
  {
    ticks.push_back({ Text(n * step), (n * step - lo) / (hi - lo) });
  }
  return ticks;
}

//------------------------------------------------------------------------------
int LegendWidth(int fontSize, bool isFlux)
{
  // Margin, bar, tick, "-1e-10", title, margin.
  return static_cast<int>(
    std::lround(fontSize * (0.6 + (isFlux ? 2.7 : 1.2) + 0.5 + 3.3 + 1.6 + 0.4)));
}

//------------------------------------------------------------------------------
Legend MakeLegend(vtkPolyData* bars, const LightLook& look, bool hasPositive, bool hasNegative,
  const std::string& title, const std::string directionNames[3], int width, int height,
  int fontSize)
{
  Legend legend;
  Drawing drawing;
  const bool isFlux = look.mode == vtkLightFieldProperty::FluxDirection;
  const bool isSigned = hasPositive && hasNegative && !isFlux;
  const bool onlyNegative = hasNegative && !hasPositive && !isFlux;
  const int columns = isFlux ? 3 : 1;

  const double x0 = 0.6 * fontSize;
  const double column = (isFlux ? 0.9 : 1.2) * fontSize;
  const double x1 = x0 + columns * column;
  const double bottom = (isFlux ? 1.9 : 0.8) * fontSize;
  const double top = height - 0.8 * fontSize;
  if (top - bottom < 2. * fontSize || width < x1)
  {
    drawing.Finish(bars);
    return legend;
  }
  const double gap = isSigned ? 0.5 * fontSize : 0.;
  const double length = isSigned ? 0.5 * (top - bottom - gap) : top - bottom;
  const int most = std::max(2, static_cast<int>(length / (1.5 * fontSize)) + 1);
  const bool linear = look.property->GetScale() == vtkLightFieldProperty::Linear;
  const std::vector<Tick> ticks = linear ? LinearTicks(look.window[0], look.window[1], most)
                                         : LogarithmicTicks(look.window[0], look.window[1], most);

  // Each bar from its smallest to its largest magnitude.
  const auto addBar = [&](double small, double large, bool isNegative)
  {
    constexpr int Steps = 64;
    for (int c = 0; c < columns; ++c)
    {
      for (int n = 0; n < Steps; ++n)
      {
        const double t[2] = { n / static_cast<double>(Steps), (n + 1.) / Steps };
        double low[3];
        double high[3];
        BarColor(look, t[0], isNegative, c, low);
        BarColor(look, t[1], isNegative, c, high);
        drawing.Quad(x0 + c * column, small + t[0] * (large - small), x0 + (c + 1) * column,
          small + t[1] * (large - small), low, high);
      }
    }
    drawing.Frame(x0, std::min(small, large), x1, std::max(small, large));
    for (const Tick& tick : ticks)
    {
      const double y = small + tick.t * (large - small);
      drawing.Line(x1, y, x1 + 0.3 * fontSize, y);
      const bool isZero = tick.text == "0";
      legend.labels.push_back(
        { (isNegative && !isZero ? "-" : "") + tick.text, x1 + 0.5 * fontSize, y, false });
    }
  };
  if (isSigned)
  {
    addBar(top - length, top, false);
    addBar(bottom + length, bottom, true);
  }
  else
  {
    addBar(onlyNegative ? top : bottom, onlyNegative ? bottom : top, onlyNegative);
  }
  if (isFlux)
  {
    for (int c = 0; c < 3; ++c)
    {
      legend.labels.push_back(
        { directionNames[c], x0 + (c + 0.2) * column, 0.9 * fontSize, false });
    }
  }
  if (width >= LegendWidth(fontSize, isFlux) - 1)
  {
    legend.labels.push_back({ title, x1 + (0.5 + 3.3) * fontSize, 0.5 * (bottom + top), true });
  }
  drawing.Finish(bars);
  return legend;
}
} // namespace lighttransport
