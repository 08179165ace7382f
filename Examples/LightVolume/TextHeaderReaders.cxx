// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "TextHeaderReaders.h"

#include "RawData.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>

namespace lightvolume
{
namespace
{
using Fields = std::map<std::string, std::string>;

// The next line of the header, without its end; false where there is none.
bool NextLine(const Bytes& bytes, std::size_t& at, std::string& line)
{
  if (at >= bytes.size())
  {
    return false;
  }
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
  const auto end = std::find(begin, bytes.end(), '\n');
  line.assign(begin, end);
  at += static_cast<std::size_t>(end - begin) + 1;
  if (!line.empty() && line.back() == '\r')
  {
    line.pop_back();
  }
  return true;
}

std::string Get(const Fields& fields, std::initializer_list<const char*> names)
{
  for (const char* name : names)
  {
    const auto found = fields.find(name);
    if (found != fields.end())
    {
      return found->second;
    }
  }
  return {};
}

bool IsTrue(const std::string& text)
{
  const std::string lower = LowerCase(text);
  return lower == "true" || lower == "1";
}

std::vector<double> Expect(const std::vector<double>& numbers, std::size_t count,
  const std::string& path, const std::string& what)
{
  if (numbers.size() != count)
  {
    throw Error("'" + path + "': " + what + " has " + std::to_string(numbers.size()) +
      " numbers; expected " + std::to_string(count));
  }
  return numbers;
}

// Text data as native doubles, so that the rest need not know.
Bytes ParseText(const Bytes& bytes, std::size_t offset, const std::string& path)
{
  const std::vector<double> values =
    Numbers(std::string(bytes.begin() + static_cast<std::ptrdiff_t>(std::min(offset, bytes.size())),
              bytes.end()),
      "the data of '" + path + "'");
  Bytes out(values.size() * sizeof(double));
  if (!out.empty())
  {
    std::memcpy(out.data(), values.data(), out.size());
  }
  return out;
}

bool NativeBigEndian()
{
#ifdef VTK_WORDS_BIGENDIAN
  return true;
#else
  return false;
#endif
}

SampleType MetaType(const std::string& name, const std::string& path)
{
  static const std::map<std::string, SampleType> types = { { "MET_UCHAR",
                                                             { SampleType::Unsigned, 1 } },
    { "MET_CHAR", { SampleType::Signed, 1 } }, { "MET_USHORT", { SampleType::Unsigned, 2 } },
    { "MET_SHORT", { SampleType::Signed, 2 } }, { "MET_UINT", { SampleType::Unsigned, 4 } },
    { "MET_INT", { SampleType::Signed, 4 } }, { "MET_ULONG", { SampleType::Unsigned, 4 } },
    { "MET_LONG", { SampleType::Signed, 4 } }, { "MET_ULONG_LONG", { SampleType::Unsigned, 8 } },
    { "MET_LONG_LONG", { SampleType::Signed, 8 } }, { "MET_FLOAT", { SampleType::Floating, 4 } },
    { "MET_DOUBLE", { SampleType::Floating, 8 } },
    { "MET_UCHAR_ARRAY", { SampleType::Unsigned, 1 } },
    { "MET_SHORT_ARRAY", { SampleType::Signed, 2 } },
    { "MET_FLOAT_ARRAY", { SampleType::Floating, 4 } } };
  const auto found = types.find(name);
  if (found == types.end())
  {
    throw Error("'" + path + "' has ElementType '" + name + "'; expected MET_UCHAR to MET_DOUBLE");
  }
  return found->second;
}

SampleType NrrdType(const std::string& name, const std::string& path)
{
  static const std::map<std::string, SampleType> types = { { "uchar", { SampleType::Unsigned, 1 } },
    { "unsigned char", { SampleType::Unsigned, 1 } }, { "uint8", { SampleType::Unsigned, 1 } },
    { "uint8_t", { SampleType::Unsigned, 1 } }, { "signed char", { SampleType::Signed, 1 } },
    { "int8", { SampleType::Signed, 1 } }, { "int8_t", { SampleType::Signed, 1 } },
    { "short", { SampleType::Signed, 2 } }, { "short int", { SampleType::Signed, 2 } },
    { "signed short", { SampleType::Signed, 2 } },
    { "signed short int", { SampleType::Signed, 2 } }, { "int16", { SampleType::Signed, 2 } },
    { "int16_t", { SampleType::Signed, 2 } }, { "ushort", { SampleType::Unsigned, 2 } },
    { "unsigned short", { SampleType::Unsigned, 2 } },
    { "unsigned short int", { SampleType::Unsigned, 2 } },
    { "uint16", { SampleType::Unsigned, 2 } }, { "uint16_t", { SampleType::Unsigned, 2 } },
    { "int", { SampleType::Signed, 4 } }, { "signed int", { SampleType::Signed, 4 } },
    { "int32", { SampleType::Signed, 4 } }, { "int32_t", { SampleType::Signed, 4 } },
    { "uint", { SampleType::Unsigned, 4 } }, { "unsigned int", { SampleType::Unsigned, 4 } },
    { "uint32", { SampleType::Unsigned, 4 } }, { "uint32_t", { SampleType::Unsigned, 4 } },
    { "longlong", { SampleType::Signed, 8 } }, { "long long", { SampleType::Signed, 8 } },
    { "long long int", { SampleType::Signed, 8 } },
    { "signed long long", { SampleType::Signed, 8 } }, { "int64", { SampleType::Signed, 8 } },
    { "int64_t", { SampleType::Signed, 8 } }, { "ulonglong", { SampleType::Unsigned, 8 } },
    { "unsigned long long", { SampleType::Unsigned, 8 } },
    { "unsigned long long int", { SampleType::Unsigned, 8 } },
    { "uint64", { SampleType::Unsigned, 8 } }, { "uint64_t", { SampleType::Unsigned, 8 } },
    { "float", { SampleType::Floating, 4 } }, { "double", { SampleType::Floating, 8 } } };
  const auto found = types.find(LowerCase(name));
  if (found == types.end())
  {
    throw Error("'" + path + "' has type '" + name +
      "'; expected an integer of 8 to 64 bits, float or double");
  }
  return found->second;
}

void CheckChoice(const std::string& path, const char* option, int value, std::int64_t count,
  const char* what, Volume& volume)
{
  if (value < 0 || value >= count)
  {
    throw Error(std::string(option) + " is " + std::to_string(value) + "; '" + path + "' has " +
      what + "s 0 to " + std::to_string(count - 1));
  }
  if (count > 1)
  {
    volume.Notes.push_back(std::string(what) + " " + std::to_string(value) + " of " +
      std::to_string(count) + " (" + option + " chooses another)");
  }
}

void PlaceIn(Volume& volume, const Affine& m, const std::string& path)
{
  try
  {
    Place(volume, m);
  }
  catch (const Error& error)
  {
    throw Error("'" + path + "': " + error.what());
  }
}

// ElementDataFile = LIST (names on the lines that follow) or a printf pattern with its range.
std::vector<std::string> MetaDataFiles(
  const std::string& value, const Bytes& bytes, std::size_t at, const std::string& folder)
{
  std::vector<std::string> files;
  const std::vector<std::string> words = Words(value);
  if (!words.empty() && words[0] == "LIST")
  {
    std::string line;
    while (NextLine(bytes, at, line))
    {
      if (!Trim(line).empty())
      {
        files.push_back(folder + Trim(line));
      }
    }
  }
  else if (words.size() >= 3 && words[0].find('%') != std::string::npos)
  {
    // Only %d, %i, %0Nd may stand there: the pattern comes from a file.
    const std::string& pattern = words[0];
    const std::size_t percent = pattern.find('%');
    const std::size_t end = pattern.find_first_not_of("0123456789", percent + 1);
    if (end == std::string::npos || (pattern[end] != 'd' && pattern[end] != 'i') ||
      pattern.find('%', end) != std::string::npos || end - percent > 3)
    {
      throw Error("ElementDataFile has the pattern '" + pattern + "'; expected one like %03d");
    }
    const std::vector<double> range =
      Numbers(value.substr(value.find(pattern) + pattern.size()), "the range of ElementDataFile");
    const double step = range.size() > 2 && range[2] > 0. ? range[2] : 1.;
    for (double n = range[0]; n <= range[1] && files.size() < 100000; n += step)
    {
      char name[1024];
      std::snprintf(name, sizeof name, pattern.c_str(), static_cast<int>(n));
      files.push_back(folder + name);
    }
  }
  else
  {
    files.push_back(folder + Trim(value));
  }
  return files;
}
} // namespace

Volume ReadMetaImage(const std::string& path, int frame, int component)
{
  const Bytes bytes = ReadBytes(path);
  Fields fields;
  std::size_t at = 0;
  std::string line;
  bool complete = false;
  while (!complete && at < 65536 && NextLine(bytes, at, line))
  {
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos)
    {
      if (Trim(line).empty())
      {
        continue;
      }
      break;
    }
    const std::string key = Trim(line.substr(0, equals));
    fields[key] = Trim(line.substr(equals + 1));
    complete = key == "ElementDataFile";
  }
  if (!complete || Get(fields, { "DimSize" }).empty())
  {
    throw Error("'" + path + "' is not a MetaImage: no DimSize and ElementDataFile in its header");
  }

  Volume volume;
  volume.Format = "MetaImage";
  volume.Unit = "mm";
  const std::vector<double> sizes = Numbers(Get(fields, { "DimSize" }), "DimSize");
  const std::size_t n = sizes.size();
  if (n < 2 || n > 4)
  {
    throw Error("'" + path + "' has " + std::to_string(n) + " dimensions; expected 2 to 4");
  }
  std::array<int, 3> dims = { { 1, 1, 1 } };
  for (std::size_t a = 0; a < std::min<std::size_t>(n, 3); ++a)
  {
    dims[a] = sizes[a] >= 1. && sizes[a] < 2147483647. ? static_cast<int>(sizes[a]) : 0;
  }
  const std::uint64_t voxels = CheckDimensions(dims, path);
  const int frames = n == 4 ? static_cast<int>(sizes[3]) : 1;
  const std::string channels = Get(fields, { "ElementNumberOfChannels" });
  const int components = channels.empty() ? 1 : static_cast<int>(Numbers(channels, "channels")[0]);
  CheckChoice(path, "--frame", frame, frames, "frame", volume);
  CheckChoice(path, "--component", component, components, "component", volume);

  // The data.
  SampleType type = MetaType(Get(fields, { "ElementType" }), path);
  bool bigEndian = IsTrue(Get(fields, { "ElementByteOrderMSB", "BinaryDataByteOrderMSB" }));
  const std::string where = Get(fields, { "ElementDataFile" });
  const std::uint64_t expected = voxels * static_cast<std::uint64_t>(components) * frames *
    static_cast<std::uint64_t>(type.Size);
  Bytes data;
  std::string dataPath = path;
  const auto compressed = IsTrue(Get(fields, { "CompressedData" }));
  if (LowerCase(where) == "local")
  {
    data.assign(
      bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size())), bytes.end());
  }
  else
  {
    for (const std::string& file : MetaDataFiles(where, bytes, at, Folder(path)))
    {
      dataPath = file;
      const Bytes piece = ReadBytes(file);
      data.insert(data.end(), piece.begin(), piece.end());
    }
  }
  const std::string headerSize = Get(fields, { "HeaderSize" });
  if (!headerSize.empty() && !compressed)
  {
    const double skip = Numbers(headerSize, "HeaderSize")[0];
    const std::uint64_t start = skip >= 0.
      ? static_cast<std::uint64_t>(skip)
      : data.size() - std::min<std::uint64_t>(data.size(), expected);
    data.erase(data.begin(),
      data.begin() + static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(start, data.size())));
  }
  if (compressed)
  {
    data = Inflate(data, dataPath, expected);
  }
  const std::string binary = Get(fields, { "BinaryData" });
  if (!binary.empty() && !IsTrue(binary))
  {
    data = ParseText(data, 0, dataPath);
    type = { SampleType::Floating, 8 };
    bigEndian = NativeBigEndian();
  }
  Selection selection;
  selection.Stride = static_cast<std::uint64_t>(components);
  selection.Start = static_cast<std::uint64_t>(frame) * voxels * selection.Stride + component;
  double slope = 1.;
  double intercept = 0.;
  const std::string slopeText = Get(fields, { "ElementToIntensityFunctionSlope" });
  const std::string interceptText = Get(fields, { "ElementToIntensityFunctionOffset" });
  if (!slopeText.empty() || !interceptText.empty())
  {
    slope = slopeText.empty() ? 1. : Numbers(slopeText, "slope")[0];
    intercept = interceptText.empty() ? 0. : Numbers(interceptText, "intercept")[0];
    volume.Notes.push_back(
      "values rescaled by " + FormatNumber(slope) + " and " + FormatNumber(intercept));
  }
  volume.Image = MakeImage(dims, data, 0, type, bigEndian, selection, slope, intercept, dataPath);

  // Where it lies. Row a of TransformMatrix is the direction of axis a.
  const std::string matrixText = Get(fields, { "TransformMatrix", "Rotation", "Orientation" });
  const std::string originText = Get(fields, { "Offset", "Position", "Origin" });
  const std::string spacingText = Get(fields, { "ElementSpacing", "ElementSize" });
  std::vector<double> matrix(n * n, 0.);
  for (std::size_t a = 0; a < n; ++a)
  {
    matrix[a * n + a] = 1.;
  }
  if (!matrixText.empty())
  {
    matrix = Expect(Numbers(matrixText, "TransformMatrix"), n * n, path, "TransformMatrix");
  }
  std::vector<double> origin(n, 0.);
  if (!originText.empty())
  {
    origin = Expect(Numbers(originText, "Offset"), n, path, "Offset");
  }
  std::vector<double> spacing(n, 1.);
  if (!spacingText.empty())
  {
    spacing = Expect(Numbers(spacingText, "ElementSpacing"), n, path, "ElementSpacing");
  }
  Affine m = Identity();
  for (std::size_t a = 0; a < std::min<std::size_t>(n, 3); ++a)
  {
    m[4 * a + 3] = origin[a];
    for (std::size_t r = 0; r < std::min<std::size_t>(n, 3); ++r)
    {
      m[4 * r + a] = matrix[a * n + r] * spacing[a];
    }
  }
  volume.IsRAS = !matrixText.empty() || !originText.empty();
  if (volume.IsRAS)
  {
    volume.Notes.push_back("LPS coordinates of the file converted to RAS");
    m = NegateXY(m);
  }
  PlaceIn(volume, m, path);
  return volume;
}

namespace
{
// "(1,0,0) none (0,1,0)" -> one entry per axis, empty for none.
std::vector<std::vector<double>> Vectors(const std::string& text, const std::string& path)
{
  std::vector<std::vector<double>> vectors;
  std::size_t at = 0;
  while ((at = text.find_first_not_of(" \t", at)) != std::string::npos)
  {
    if (text[at] == '(')
    {
      const std::size_t end = text.find(')', at);
      if (end == std::string::npos)
      {
        throw Error("'" + path + "' has the vector '" + text.substr(at) + "' without its ')'");
      }
      vectors.push_back(Numbers(text.substr(at + 1, end - at - 1), "a vector of '" + path + "'"));
      at = end + 1;
    }
    else
    {
      const std::size_t end = std::min(text.find_first_of(" \t", at), text.size());
      if (text.substr(at, end - at) != "none")
      {
        throw Error("'" + path + "' has '" + text + "'; expected vectors (x,y,z) or none");
      }
      vectors.emplace_back();
      at = end;
    }
  }
  return vectors;
}
} // namespace

Volume ReadNrrd(const std::string& path, int frame, int component)
{
  const Bytes bytes = ReadBytes(path);
  std::size_t at = 0;
  std::string line;
  if (!NextLine(bytes, at, line) || line.compare(0, 7, "NRRD000") != 0)
  {
    throw Error("'" + path + "' is not a NRRD file: it does not begin with NRRD000");
  }
  Fields fields;
  while (NextLine(bytes, at, line) && !line.empty())
  {
    const std::size_t colon = line.find(':');
    if (line[0] == '#' || colon == std::string::npos || line.compare(colon, 2, ":=") == 0)
    {
      continue;
    }
    fields[LowerCase(Trim(line.substr(0, colon)))] = Trim(line.substr(colon + 1));
  }

  Volume volume;
  volume.Format = "NRRD";
  const std::vector<double> sizes = Numbers(Get(fields, { "sizes" }), "sizes");
  const std::size_t n = sizes.size();
  if (n < 2 || n > 4)
  {
    throw Error("'" + path + "' has " + std::to_string(n) + " axes; expected 2 to 4");
  }
  // Which axes are space: those with a direction; without directions, by their kinds; failing
  // that, all but a fourth one (which is first where it is short: colours, last otherwise).
  std::vector<std::vector<double>> directions = Vectors(Get(fields, { "space directions" }), path);
  const std::vector<std::string> kinds = Words(LowerCase(Get(fields, { "kinds" })));
  std::vector<bool> spatial(n, true);
  if (!directions.empty())
  {
    if (directions.size() != n)
    {
      throw Error("'" + path + "' has " + std::to_string(directions.size()) +
        " space directions; expected " + std::to_string(n));
    }
    for (std::size_t a = 0; a < n; ++a)
    {
      spatial[a] = !directions[a].empty();
    }
  }
  else if (kinds.size() == n &&
    std::any_of(kinds.begin(), kinds.end(),
      [](const std::string& k) { return k != "domain" && k != "space" && k != "???"; }))
  {
    for (std::size_t a = 0; a < n; ++a)
    {
      spatial[a] = kinds[a] == "domain" || kinds[a] == "space" || kinds[a] == "???";
    }
  }
  else if (n == 4)
  {
    spatial[sizes[0] <= 4. ? 0 : 3] = false;
  }
  std::vector<std::size_t> axes;
  std::size_t other = n;
  for (std::size_t a = 0; a < n; ++a)
  {
    if (spatial[a])
    {
      axes.push_back(a);
    }
    else
    {
      other = other == n ? a : n + 1;
    }
  }
  if (axes.size() > 3 || axes.size() < 2 || other == n + 1 ||
    (other != n && other != 0 && other != n - 1))
  {
    throw Error("'" + path + "' has " + std::to_string(axes.size()) +
      " spatial axes and others between them; expected 2 or 3, and at most one other, first or "
      "last");
  }
  std::array<int, 3> dims = { { 1, 1, 1 } };
  for (std::size_t a = 0; a < axes.size(); ++a)
  {
    const double s = sizes[axes[a]];
    dims[a] = s >= 1. && s < 2147483647. ? static_cast<int>(s) : 0;
  }
  const std::uint64_t voxels = CheckDimensions(dims, path);
  const auto otherCount = other < n ? static_cast<std::uint64_t>(sizes[other]) : 1;
  Selection selection;
  std::uint64_t samples = voxels * otherCount;
  if (other == 0)
  {
    CheckChoice(
      path, "--component", component, static_cast<std::int64_t>(otherCount), "component", volume);
    selection.Stride = otherCount;
    selection.Start = static_cast<std::uint64_t>(component);
  }
  else
  {
    CheckChoice(path, "--frame", frame, static_cast<std::int64_t>(otherCount), "frame", volume);
    selection.Start = static_cast<std::uint64_t>(frame) * voxels;
  }

  // The data.
  SampleType type = NrrdType(Get(fields, { "type" }), path);
  const std::string encoding = LowerCase(Get(fields, { "encoding" }));
  bool bigEndian = LowerCase(Get(fields, { "endian" })) == "big";
  std::string dataPath = Get(fields, { "data file", "datafile" });
  Bytes data;
  if (dataPath.empty())
  {
    dataPath = path;
    data.assign(
      bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size())), bytes.end());
  }
  else
  {
    if (dataPath.compare(0, 4, "LIST") == 0 || dataPath.find('%') != std::string::npos)
    {
      throw Error(
        "'" + path + "' spreads its data over several files ('" + dataPath + "'); expected one");
    }
    dataPath = dataPath[0] == '/' ? dataPath : Folder(path) + dataPath;
    data = ReadBytes(dataPath);
  }
  const std::uint64_t expected = samples * static_cast<std::uint64_t>(type.Size);
  const std::string lineSkip = Get(fields, { "line skip", "lineskip" });
  std::size_t start = 0;
  for (double s = lineSkip.empty() ? 0. : Numbers(lineSkip, "line skip")[0]; s > 0.; s -= 1.)
  {
    NextLine(data, start, line);
  }
  data.erase(
    data.begin(), data.begin() + static_cast<std::ptrdiff_t>(std::min(start, data.size())));
  const bool zipped = encoding == "gzip" || encoding == "gz";
  const std::string byteSkip = Get(fields, { "byte skip", "byteskip" });
  const double skip = byteSkip.empty() ? 0. : Numbers(byteSkip, "byte skip")[0];
  if (zipped)
  {
    data = Inflate(data, dataPath, expected + (skip > 0. ? static_cast<std::uint64_t>(skip) : 0));
  }
  std::uint64_t offset = 0;
  if (skip < 0.)
  {
    offset = data.size() - std::min<std::uint64_t>(data.size(), expected);
  }
  else
  {
    offset = static_cast<std::uint64_t>(skip);
  }
  if (encoding == "ascii" || encoding == "txt" || encoding == "text")
  {
    data = ParseText(data, offset, dataPath);
    offset = 0;
    type = { SampleType::Floating, 8 };
    bigEndian = NativeBigEndian();
  }
  else if (encoding != "raw" && !zipped)
  {
    throw Error("'" + path + "' has encoding '" + encoding + "'; expected raw, gzip or ascii");
  }
  volume.Image = MakeImage(dims, data, offset, type, bigEndian, selection, 1., 0., dataPath);

  // Where it lies.
  const std::string space = LowerCase(Get(fields, { "space" }));
  const auto is = [&space](std::initializer_list<const char*> names)
  {
    return std::any_of(
      names.begin(), names.end(), [&space](const char* name) { return space == name; });
  };
  const bool lps = is({ "left-posterior-superior", "lps" });
  const bool las = is({ "left-anterior-superior", "las" });
  const bool ras = is({ "right-anterior-superior", "ras" });
  volume.IsRAS = lps || las || ras;
  volume.Unit = volume.IsRAS ? "mm" : "unit";
  const std::string units = Get(fields, { "space units" });
  const std::size_t quote = units.find('"');
  if (quote != std::string::npos && units.find('"', quote + 1) != std::string::npos)
  {
    volume.Unit = units.substr(quote + 1, units.find('"', quote + 1) - quote - 1);
  }
  Affine m = Identity();
  if (!directions.empty())
  {
    for (std::size_t a = 0; a < axes.size(); ++a)
    {
      const std::vector<double>& d = directions[axes[a]];
      if (d.size() < 2 || d.size() > 3)
      {
        throw Error("'" + path + "' has a space direction of " + std::to_string(d.size()) +
          " numbers; expected 3");
      }
      for (std::size_t r = 0; r < 3; ++r)
      {
        m[4 * r + a] = r < d.size() ? d[r] : 0.;
      }
    }
    if (axes.size() == 2)
    {
      m[2] = m[4] * m[9] - m[8] * m[5]; // the missing axis: a cross product, made a unit vector
      m[6] = m[8] * m[1] - m[0] * m[9];
      m[10] = m[0] * m[5] - m[4] * m[1];
      const double length = std::sqrt(m[2] * m[2] + m[6] * m[6] + m[10] * m[10]);
      for (int r = 0; r < 3; ++r)
      {
        m[4 * r + 2] /= length;
      }
    }
    const auto origin = Vectors(Get(fields, { "space origin" }), path);
    for (std::size_t r = 0; !origin.empty() && r < std::min<std::size_t>(origin[0].size(), 3); ++r)
    {
      m[4 * r + 3] = origin[0][r];
    }
  }
  else
  {
    std::string spacings = Get(fields, { "spacings" });
    const std::string mins = Get(fields, { "axis mins", "axismins" });
    std::vector<double> spacing(n, 1.);
    if (!spacings.empty())
    {
      spacing = Expect(Numbers(spacings, "spacings"), n, path, "spacings");
    }
    std::vector<double> minimum(n, 0.);
    if (!mins.empty())
    {
      minimum = Expect(Numbers(mins, "axis mins"), n, path, "axis mins");
    }
    for (std::size_t a = 0; a < axes.size(); ++a)
    {
      m[5 * a] = std::isnan(spacing[axes[a]]) ? 1. : spacing[axes[a]];
      m[4 * a + 3] = std::isnan(minimum[axes[a]]) ? 0. : minimum[axes[a]];
    }
    volume.IsRAS = false;
    volume.Notes.push_back("no space directions: world is spacing times index, not RAS");
  }
  if (volume.IsRAS && lps)
  {
    m = NegateXY(m);
    volume.Notes.push_back("LPS coordinates of the file converted to RAS");
  }
  else if (volume.IsRAS && las)
  {
    for (int c = 0; c < 4; ++c)
    {
      m[c] = m[c] == 0. ? 0. : -m[c];
    }
    volume.Notes.push_back("LAS coordinates of the file converted to RAS");
  }
  PlaceIn(volume, m, path);
  return volume;
}

} // namespace lightvolume
