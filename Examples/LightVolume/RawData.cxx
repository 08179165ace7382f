// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "RawData.h"

#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkPointData.h"
#include "vtk_zlib.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>

namespace lightvolume
{
namespace
{
template <typename T>
T Load(const unsigned char* from, bool swap)
{
  unsigned char raw[sizeof(T)];
  std::memcpy(raw, from, sizeof(T));
  if (swap)
  {
    std::reverse(raw, raw + sizeof(T));
  }
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return value;
}

template <typename T, typename Out>
void Convert(const unsigned char* from, std::uint64_t n, std::uint64_t stride, bool swap,
  double slope, double intercept, Out* to)
{
  if (slope == 1. && intercept == 0.)
  {
    for (std::uint64_t i = 0; i < n; ++i)
    {
      to[i] = static_cast<Out>(Load<T>(from + i * stride * sizeof(T), swap));
    }
    return;
  }
  for (std::uint64_t i = 0; i < n; ++i)
  {
    to[i] = static_cast<Out>(
      static_cast<double>(Load<T>(from + i * stride * sizeof(T), swap)) * slope + intercept);
  }
}

// T is the file's type, Wide what rescaled values are kept in.
template <typename T, typename Plain, typename Wide>
void Fill(vtkImageData* image, int plainType, int wideType, const unsigned char* from,
  std::uint64_t stride, bool swap, double slope, double intercept)
{
  const bool rescaled = !(slope == 1. && intercept == 0.);
  image->AllocateScalars(rescaled ? wideType : plainType, 1);
  void* to = image->GetScalarPointer();
  const auto n = static_cast<std::uint64_t>(image->GetNumberOfPoints());
  if (rescaled)
  {
    Convert<T>(from, n, stride, swap, slope, intercept, static_cast<Wide*>(to));
  }
  else
  {
    Convert<T>(from, n, stride, swap, slope, intercept, static_cast<Plain*>(to));
  }
}
} // namespace

Bytes ReadBytes(const std::string& path, std::uint64_t offset)
{
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file)
  {
    throw Error("cannot open '" + path + "': " + std::strerror(errno));
  }
  const auto size = static_cast<std::int64_t>(file.tellg());
  if (size < 0)
  {
    throw Error("cannot read '" + path + "': not a plain file");
  }
  if (static_cast<std::uint64_t>(size) < offset)
  {
    throw Error("'" + path + "' is truncated: it has " + std::to_string(size) +
      " bytes and its data should begin at byte " + std::to_string(offset));
  }
  Bytes bytes(static_cast<std::size_t>(size) - offset);
  file.seekg(static_cast<std::streamoff>(offset));
  if (!bytes.empty() &&
    !file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size())))
  {
    throw Error("cannot read '" + path + "': " + std::strerror(errno));
  }
  return bytes;
}

bool IsGzip(const Bytes& bytes)
{
  return bytes.size() > 2 && bytes[0] == 0x1f && bytes[1] == 0x8b;
}

Bytes Inflate(const Bytes& bytes, const std::string& path, std::uint64_t limit)
{
  z_stream stream;
  std::memset(&stream, 0, sizeof stream);
  // 15: the largest window; +32: gzip or zlib, whichever the header says.
  if (inflateInit2(&stream, 15 + 32) != Z_OK)
  {
    throw Error("cannot start zlib for '" + path + "'");
  }
  Bytes out;
  Bytes chunk(1 << 20);
  std::size_t consumed = 0;
  int status = Z_OK;
  bool ended = false; // a whole member was unpacked: what follows it may be padding
  while (out.size() < limit)
  {
    if (stream.avail_in == 0 && consumed < bytes.size())
    {
      const std::size_t piece = std::min<std::size_t>(bytes.size() - consumed, 1U << 30);
      stream.next_in = const_cast<unsigned char*>(bytes.data() + consumed);
      stream.avail_in = static_cast<unsigned int>(piece);
      consumed += piece;
    }
    stream.next_out = chunk.data();
    stream.avail_out = static_cast<unsigned int>(chunk.size());
    status = inflate(&stream, Z_NO_FLUSH);
    out.insert(out.end(), chunk.data(), chunk.data() + (chunk.size() - stream.avail_out));
    if (status == Z_STREAM_END)
    {
      ended = true;
      if (stream.avail_in == 0 && consumed == bytes.size())
      {
        break;
      }
      if (inflateReset(&stream) != Z_OK)
      {
        break;
      }
      continue;
    }
    if (status == Z_OK)
    {
      ended = ended && stream.total_out == 0;
    }
    else
    {
      break;
    }
  }
  const std::string reason = stream.msg ? stream.msg : "unexpected end of the compressed data";
  inflateEnd(&stream);
  if (!ended && out.size() < limit)
  {
    throw Error("'" + path + "' is truncated or damaged: " + reason + " after " +
      std::to_string(out.size()) + " unpacked bytes");
  }
  return out;
}

std::uint64_t CheckDimensions(const std::array<int, 3>& dims, const std::string& path)
{
  double product = 1.;
  for (int d : dims)
  {
    if (d < 1)
    {
      throw Error("'" + path + "' has dimensions " + std::to_string(dims[0]) + " x " +
        std::to_string(dims[1]) + " x " + std::to_string(dims[2]) + "; expected each at least 1");
    }
    product *= d;
  }
  if (product > 1e12)
  {
    throw Error("'" + path + "' claims " + FormatNumber(product) +
      " voxels; this is either a damaged header or too large for this program");
  }
  return static_cast<std::uint64_t>(product);
}

vtkSmartPointer<vtkImageData> MakeImage(const std::array<int, 3>& dims, const Bytes& bytes,
  std::uint64_t offset, SampleType type, bool bigEndian, const Selection& selection, double slope,
  double intercept, const std::string& path)
{
  const std::uint64_t voxels = CheckDimensions(dims, path);
  const auto size = static_cast<std::uint64_t>(type.Size);
  // The last sample needed, not the last of its tuple: that one is there too, or the file is short.
  const std::uint64_t needed = offset +
    size * (selection.Start / selection.Stride * selection.Stride + voxels * selection.Stride);
  if (bytes.size() < needed)
  {
    throw Error("'" + path + "' is truncated: " + std::to_string(bytes.size()) +
      " bytes, expected at least " + std::to_string(needed));
  }
  vtkNew<vtkImageData> image;
  image->SetDimensions(dims[0], dims[1], dims[2]);
#ifdef VTK_WORDS_BIGENDIAN
  const bool swap = !bigEndian && type.Size > 1;
#else
  const bool swap = bigEndian && type.Size > 1;
#endif
  const unsigned char* from = bytes.data() + offset + selection.Start * size;
  const std::uint64_t stride = selection.Stride;
  const int code = type.Of * 16 + type.Size;
  switch (code)
  {
    case SampleType::Unsigned * 16 + 1:
      Fill<std::uint8_t, std::uint8_t, float>(
        image, VTK_UNSIGNED_CHAR, VTK_FLOAT, from, stride, swap, slope, intercept);
      break;
    case SampleType::Signed * 16 + 1:
      Fill<std::int8_t, std::int8_t, float>(
        image, VTK_SIGNED_CHAR, VTK_FLOAT, from, stride, swap, slope, intercept);
      break;
    case SampleType::Unsigned * 16 + 2:
      Fill<std::uint16_t, std::uint16_t, float>(
        image, VTK_UNSIGNED_SHORT, VTK_FLOAT, from, stride, swap, slope, intercept);
      break;
    case SampleType::Signed * 16 + 2:
      Fill<std::int16_t, std::int16_t, float>(
        image, VTK_SHORT, VTK_FLOAT, from, stride, swap, slope, intercept);
      break;
    case SampleType::Unsigned * 16 + 4:
      Fill<std::uint32_t, std::uint32_t, double>(
        image, VTK_UNSIGNED_INT, VTK_DOUBLE, from, stride, swap, slope, intercept);
      break;
    case SampleType::Signed * 16 + 4:
      Fill<std::int32_t, std::int32_t, double>(
        image, VTK_INT, VTK_DOUBLE, from, stride, swap, slope, intercept);
      break;
    case SampleType::Unsigned * 16 + 8:
      Fill<std::uint64_t, double, double>(
        image, VTK_DOUBLE, VTK_DOUBLE, from, stride, swap, slope, intercept);
      break;
    case SampleType::Signed * 16 + 8:
      Fill<std::int64_t, double, double>(
        image, VTK_DOUBLE, VTK_DOUBLE, from, stride, swap, slope, intercept);
      break;
    case SampleType::Floating * 16 + 4:
      Fill<float, float, float>(image, VTK_FLOAT, VTK_FLOAT, from, stride, swap, slope, intercept);
      break;
    case SampleType::Floating * 16 + 8:
      Fill<double, double, double>(
        image, VTK_DOUBLE, VTK_DOUBLE, from, stride, swap, slope, intercept);
      break;
    default:
      throw Error("'" + path + "' has samples of " + std::to_string(type.Size) +
        " bytes; expected 1, 2, 4 or 8");
  }
  return image;
}

std::string Folder(const std::string& path)
{
  const std::size_t slash = path.find_last_of('/');
  return slash == std::string::npos ? std::string() : path.substr(0, slash + 1);
}

std::string LowerCase(std::string text)
{
  std::transform(text.begin(), text.end(), text.begin(),
    [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string Trim(const std::string& text)
{
  const char* blanks = " \t\r\n";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string::npos)
  {
    return {};
  }
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::vector<std::string> Words(const std::string& text)
{
  std::istringstream in(text);
  std::vector<std::string> words;
  std::string word;
  while (in >> word)
  {
    words.push_back(word);
  }
  return words;
}

std::vector<double> Numbers(const std::string& text, const std::string& what)
{
  std::string plain = text;
  std::replace_if(
    plain.begin(), plain.end(), [](char c) { return c == ',' || c == '(' || c == ')'; }, ' ');
  std::vector<double> numbers;
  for (const std::string& word : Words(plain))
  {
    char* end = nullptr;
    numbers.push_back(std::strtod(word.c_str(), &end));
    if (end == word.c_str() || *end != '\0')
    {
      throw Error(what + " is '" + text + "'; expected numbers");
    }
  }
  return numbers;
}

} // namespace lightvolume
