// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "SegyReader.h"

#ifndef LIGHTVOLUME_SEGYIO

namespace lightvolume
{
Volume ReadSegy(const std::string& path, int, int, double)
{
  throw Error("cannot read '" + path +
    "': this light-volume was built without segyio (install libsegyio-dev and build again)");
}
} // namespace lightvolume

#else

#include "vtkMath.h"
#include "vtkPointData.h"

#include <segyio/segy.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <set>

namespace lightvolume
{
namespace
{
struct Closer
{
  void operator()(segy_file* file) const { segy_close(file); }
};
using File = std::unique_ptr<segy_file, Closer>;

struct Trace
{
  int Inline;
  int Crossline;
  double X;
  double Y;
  double Delay; // ms
  bool Dead;
};

int Field(const char* header, int field)
{
  std::int32_t value = 0;
  segy_get_field(header, field, &value);
  return value;
}

// The standard's coordinate scalar: positive multiplies, negative divides, 0 means 1.
double Scalar(int code)
{
  return code == 0 ? 1. : code > 0 ? code : -1. / code;
}

struct Lines
{
  int First = 0;
  int Step = 1;
  int Count = 1;
};

Lines FindLines(const std::set<int>& numbers)
{
  Lines lines;
  lines.First = *numbers.begin();
  int step = 0;
  for (int n : numbers)
  {
    step = std::gcd(step, n - lines.First);
  }
  lines.Step = std::max(step, 1);
  lines.Count = (*numbers.rbegin() - lines.First) / lines.Step + 1;
  return lines;
}

// Least squares of x = c + a i + b j over the traces; the largest residual comes back.
double FitPlane(const std::vector<std::array<double, 3>>& samples, bool useI, bool useJ, double& a,
  double& b, double& c)
{
  // Centred, so that large coordinates cost no digits.
  double mean[3] = { 0, 0, 0 };
  for (const auto& s : samples)
  {
    for (int d = 0; d < 3; ++d)
    {
      mean[d] += s[d] / static_cast<double>(samples.size());
    }
  }
  double ii = 0;
  double ij = 0;
  double jj = 0;
  double ix = 0;
  double jx = 0;
  for (const auto& s : samples)
  {
    const double i = s[0] - mean[0];
    const double j = s[1] - mean[1];
    const double x = s[2] - mean[2];
    ii += i * i;
    ij += i * j;
    jj += j * j;
    ix += i * x;
    jx += j * x;
  }
  a = b = 0.;
  const double determinant = ii * jj - ij * ij;
  if (useI && useJ && determinant > 0.)
  {
    a = (ix * jj - jx * ij) / determinant;
    b = (jx * ii - ix * ij) / determinant;
  }
  else if (useI && ii > 0.)
  {
    a = ix / ii;
  }
  else if (useJ && jj > 0.)
  {
    b = jx / jj;
  }
  c = mean[2] - a * mean[0] - b * mean[1];
  double worst = 0.;
  for (const auto& s : samples)
  {
    worst = std::max(worst, std::abs(s[2] - (c + a * s[0] + b * s[1])));
  }
  return worst;
}
} // namespace

Volume ReadSegy(const std::string& path, int inlineByte, int crosslineByte, double zScale)
{
  // Little-endian files (SEG-Y 2, Seismic Unix) show by their format code.
  unsigned char head[3600];
  {
    std::ifstream raw(path, std::ios::binary);
    if (!raw)
    {
      throw Error("cannot open '" + path + "': " + std::strerror(errno));
    }
    if (!raw.read(reinterpret_cast<char*>(head), sizeof head))
    {
      throw Error("'" + path + "' is truncated: expected the 3600 bytes of SEG-Y's headers");
    }
  }
  const int big = head[3224] * 256 + head[3225];
  const int little = head[3225] * 256 + head[3224];
  const auto known = [](int code)
  { return code >= 1 && code <= 8 && code != 4 && code != 6 && code != 7; };
  if (!known(big) && !known(little))
  {
    throw Error("'" + path + "' has the sample format " + std::to_string(big) +
      "; expected 1 (IBM float), 2, 3, 8 (integers) or 5 (IEEE float); is it SEG-Y?");
  }
  const int format = known(big) ? big : little;
  const File file(segy_open(path.c_str(), "rb"));
  if (!file)
  {
    throw Error("cannot open '" + path + "' as SEG-Y");
  }
  segy_set_format(file.get(), format | (known(big) ? SEGY_MSB : SEGY_LSB));
  char binary[SEGY_BINARY_HEADER_SIZE] = { 0 };
  if (segy_binheader(file.get(), binary) != SEGY_OK)
  {
    throw Error("cannot read the binary header of '" + path + "'");
  }
  const int samples = segy_samples(binary);
  if (samples < 1)
  {
    throw Error("'" + path + "' has " + std::to_string(samples) +
      " samples per trace in its binary header; expected at least 1");
  }
  const long trace0 = segy_trace0(binary);
  const int traceBytes = segy_trsize(format, samples);
  int traceCount = 0;
  if (segy_traces(file.get(), &traceCount, trace0, traceBytes) != SEGY_OK || traceCount < 1)
  {
    throw Error("'" + path +
      "' is truncated or not SEG-Y: its size is no whole number of traces of " +
      std::to_string(traceBytes + SEGY_TRACE_HEADER_SIZE) + " bytes (" + std::to_string(samples) +
      " samples, format " + std::to_string(format) + ") after " + std::to_string(trace0) +
      " bytes");
  }

  // Line numbers: the first pair of header words that tells the traces apart.
  std::vector<std::pair<int, int>> words;
  if (inlineByte > 0 && crosslineByte > 0)
  {
    words.emplace_back(inlineByte, crosslineByte);
  }
  else
  {
    words = { { SEGY_TR_INLINE, SEGY_TR_CROSSLINE }, { SEGY_TR_FIELD_RECORD, SEGY_TR_ENSEMBLE },
      { SEGY_TR_SEQ_FILE, SEGY_TR_ENSEMBLE } };
  }
  std::vector<std::array<char, SEGY_TRACE_HEADER_SIZE>> headers(
    static_cast<std::size_t>(traceCount));
  for (int t = 0; t < traceCount; ++t)
  {
    if (segy_traceheader(file.get(), t, headers[t].data(), trace0, traceBytes) != SEGY_OK)
    {
      throw Error("cannot read the header of trace " + std::to_string(t) + " of '" + path + "'");
    }
  }
  Volume volume;
  volume.Format = "SEG-Y";
  std::vector<Trace> traces;
  Lines inlines;
  Lines crosslines;
  bool found = false;
  for (const auto& word : words)
  {
    std::int32_t probe = 0;
    if (segy_get_field(headers[0].data(), word.first, &probe) != SEGY_OK ||
      segy_get_field(headers[0].data(), word.second, &probe) != SEGY_OK)
    {
      throw Error("--inline-byte " + std::to_string(word.first) + " or --crossline-byte " +
        std::to_string(word.second) + " is not the first byte of a word of SEG-Y's trace header");
    }
    std::set<int> ils;
    std::set<int> xls;
    std::set<std::pair<int, int>> positions;
    for (const auto& header : headers)
    {
      const int il = Field(header.data(), word.first);
      const int xl = Field(header.data(), word.second);
      ils.insert(il);
      xls.insert(xl);
      positions.emplace(il, xl);
    }
    if (static_cast<int>(positions.size()) != traceCount)
    {
      continue;
    }
    inlines = FindLines(ils);
    crosslines = FindLines(xls);
    // Mostly empty: these are no line numbers.
    if (static_cast<double>(inlines.Count) * crosslines.Count > 8. * traceCount + 64.)
    {
      continue;
    }
    found = true;
    volume.Notes.push_back("inline numbers from byte " + std::to_string(word.first) + ": " +
      std::to_string(inlines.First) + " to " +
      std::to_string(inlines.First + (inlines.Count - 1) * inlines.Step) + " by " +
      std::to_string(inlines.Step) + "; crossline from byte " + std::to_string(word.second) + ": " +
      std::to_string(crosslines.First) + " to " +
      std::to_string(crosslines.First + (crosslines.Count - 1) * crosslines.Step) + " by " +
      std::to_string(crosslines.Step));
    for (const auto& header : headers)
    {
      const char* h = header.data();
      Trace trace;
      trace.Inline = (Field(h, word.first) - inlines.First) / inlines.Step;
      trace.Crossline = (Field(h, word.second) - crosslines.First) / crosslines.Step;
      const double scale = Scalar(Field(h, SEGY_TR_SOURCE_GROUP_SCALAR));
      int x = Field(h, SEGY_TR_CDP_X);
      int y = Field(h, SEGY_TR_CDP_Y);
      if (x == 0 && y == 0)
      {
        x = Field(h, SEGY_TR_SOURCE_X);
        y = Field(h, SEGY_TR_SOURCE_Y);
      }
      trace.X = x * scale;
      trace.Y = y * scale;
      trace.Delay = Field(h, SEGY_TR_DELAY_REC_TIME);
      trace.Dead = Field(h, SEGY_TR_TRACE_ID) == 2;
      traces.push_back(trace);
    }
    break;
  }
  if (!found)
  {
    throw Error("'" + path +
      "' is not a post-stack 3-D file: no pair of trace header words gives "
      "each of its " +
      std::to_string(traceCount) +
      " traces an inline and a crossline of its own (--inline-byte and --crossline-byte name "
      "them)");
  }

  // Samples. Integers without holes keep their type.
  const int dims[3] = { inlines.Count, crosslines.Count, samples };
  const std::size_t plane = static_cast<std::size_t>(dims[0]) * dims[1];
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> values(plane * samples, nothing);
  std::vector<char> raw(static_cast<std::size_t>(traceBytes));
  std::size_t dead = 0;
  std::size_t null = 0;
  for (int t = 0; t < traceCount; ++t)
  {
    if (segy_readtrace(file.get(), t, raw.data(), trace0, traceBytes) != SEGY_OK ||
      segy_to_native(format, samples, raw.data()) != SEGY_OK)
    {
      throw Error("cannot read trace " + std::to_string(t) + " of '" + path + "'");
    }
    const auto value = [&raw, format](int k) -> double
    {
      switch (format)
      {
        case SEGY_SIGNED_SHORT_2_BYTE:
        {
          std::int16_t v;
          std::memcpy(&v, raw.data() + 2 * k, 2);
          return v;
        }
        case SEGY_SIGNED_INTEGER_4_BYTE:
        {
          std::int32_t v;
          std::memcpy(&v, raw.data() + 4 * k, 4);
          return v;
        }
        case SEGY_SIGNED_CHAR_1_BYTE:
          return static_cast<signed char>(raw[k]);
        default:
        {
          float v;
          std::memcpy(&v, raw.data() + 4 * k, 4);
          return v;
        }
      }
    };
    bool empty = true;
    for (int k = 0; k < samples && empty; ++k)
    {
      empty = value(k) == 0.;
    }
    if (traces[t].Dead || empty)
    {
      ++dead;
      continue;
    }
    float* to = values.data() + traces[t].Inline +
      static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(traces[t].Crossline);
    for (int k = 0; k < samples; ++k)
    {
      const double v = value(k);
      const bool missing = !std::isfinite(v) || v == -999.25 || std::abs(v) >= 1e30;
      null += missing ? 1 : 0;
      to[plane * k] = missing ? nothing : static_cast<float>(v);
    }
  }
  const std::size_t missing = plane - static_cast<std::size_t>(traceCount);
  const bool holes = missing + dead + null > 0;
  if (dead == static_cast<std::size_t>(traceCount))
  {
    throw Error("'" + path + "' holds no data: every trace is dead or zero");
  }
  if (holes)
  {
    volume.Notes.push_back("no data: " + std::to_string(missing) + " missing traces, " +
      std::to_string(dead) + " dead ones, " + std::to_string(null) + " null samples");
  }
  volume.Image = vtkSmartPointer<vtkImageData>::New();
  volume.Image->SetDimensions(dims);
  const bool shorts = format == SEGY_SIGNED_SHORT_2_BYTE && !holes;
  volume.Image->AllocateScalars(shorts ? VTK_SHORT : VTK_FLOAT, 1);
  if (shorts)
  {
    std::transform(values.begin(), values.end(),
      static_cast<short*>(volume.Image->GetScalarPointer()),
      [](float v) { return static_cast<short>(v); });
  }
  else
  {
    std::copy(values.begin(), values.end(), static_cast<float*>(volume.Image->GetScalarPointer()));
  }

  // Where it lies. segyio hands out what the headers say; 0 there means nobody said.
  int interval = Field(headers[0].data(), SEGY_TR_SAMPLE_INTER);
  std::int32_t fromBinary = 0;
  segy_get_bfield(binary, SEGY_BIN_INTERVAL, &fromBinary);
  interval = fromBinary > 0 ? fromBinary : interval;
  if (interval <= 0)
  {
    interval = 4000;
    volume.Notes.push_back("no sample interval in the headers: 4 ms assumed");
  }
  const double dz = interval / 1000. * zScale;
  double delay = traces[0].Delay;
  for (const Trace& trace : traces)
  {
    if (trace.Delay != delay)
    {
      volume.Notes.push_back("the traces begin at different times; the first one's is used");
      break;
    }
  }
  std::int32_t system = 0;
  segy_get_bfield(binary, SEGY_BIN_MEASUREMENT_SYSTEM, &system);
  const std::string unit = system == 2 ? "ft" : "m";

  const bool manyI = dims[0] > 1;
  const bool manyJ = dims[1] > 1;
  std::vector<std::array<double, 3>> xs;
  std::vector<std::array<double, 3>> ys;
  for (const Trace& t : traces)
  {
    xs.push_back({ { double(t.Inline), double(t.Crossline), t.X } });
    ys.push_back({ { double(t.Inline), double(t.Crossline), t.Y } });
  }
  double ax = 0;
  double bx = 0;
  double cx = 0;
  double ay = 0;
  double by = 0;
  double cy = 0;
  const double residual =
    std::max(FitPlane(xs, manyI, manyJ, ax, bx, cx), FitPlane(ys, manyI, manyJ, ay, by, cy));
  double hi = std::hypot(ax, ay);
  double hj = std::hypot(bx, by);
  // A single line has no direction across: a right angle, and the other's step.
  if (!manyI && hj > 0.)
  {
    ax = by;
    ay = -bx;
    hi = hj;
  }
  if (!manyJ && hi > 0.)
  {
    bx = ay;
    by = -ax;
    hj = hi;
  }
  const double step = std::min(hi, hj);
  volume.AxisNames = { { "inline", "crossline", "time" } };
  volume.Unit = unit;
  Affine m = Identity();
  const double cosine = step > 0. ? std::abs(ax * bx + ay * by) / (hi * hj) : 1.;
  if (step > 0. && residual < .5 * step && cosine < .08)
  {
    m = { { ax, bx, 0, cx, ay, by, 0, cy, 0, 0, -dz, -delay * zScale, 0, 0, 0, 1 } };
    volume.Notes.push_back("x, y: CDP coordinates in " + unit + " (lines " + FormatNumber(hi) +
      " and " + FormatNumber(hj) + " apart); z: minus time, 1 ms drawn as " + FormatNumber(zScale) +
      " " + unit + " (--z-scale)");
  }
  else
  {
    // Square pixels: nothing says how far apart lines are.
    m = { { dz, 0, 0, 0, 0, dz, 0, 0, 0, 0, -dz, -delay * zScale, 0, 0, 0, 1 } };
    volume.Unit = "unit";
    volume.Notes.push_back(std::string("the CDP coordinates are ") +
      (step > 0. ? "not on a rectangular grid" : "missing") +
      ": lines are drawn one sample interval apart; z is minus time in ms");
  }
  Place(volume, m, true);
  return volume;
}

} // namespace lightvolume

#endif
