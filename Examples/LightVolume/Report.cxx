// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Report.h"

#include "RawData.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include <sys/stat.h>
#include <unistd.h>

namespace lightvolume
{
namespace
{
std::string Quote(const std::string& text)
{
  std::string out = "\"";
  for (const char c : text)
  {
    switch (c)
    {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\t':
        out += "\\t";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20)
        {
          char escape[8];
          std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned char>(c));
          out += escape;
        }
        else
        {
          out += c;
        }
    }
  }
  return out + "\"";
}
} // namespace

Json::Json(double value)
  : Of(Scalar)
{
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  // The shortest digits that read back as the same number.
  for (int digits = 1; digits < 17; ++digits)
  {
    char shorter[40];
    std::snprintf(shorter, sizeof shorter, "%.*g", digits, value);
    if (std::strtod(shorter, nullptr) == value)
    {
      std::strcpy(text, shorter);
      break;
    }
  }
  this->Text = std::isfinite(value) ? text : "null";
}

Json::Json(int value)
  : Of(Scalar)
  , Text(std::to_string(value))
{
}

Json::Json(bool value)
  : Of(Scalar)
  , Text(value ? "true" : "false")
{
}

Json::Json(const char* value)
  : Of(Scalar)
  , Text(Quote(value))
{
}

Json::Json(const std::string& value)
  : Of(Scalar)
  , Text(Quote(value))
{
}

Json& Json::operator[](const std::string& key)
{
  this->Of = Object;
  for (auto& item : this->Items)
  {
    if (item.first == key)
    {
      return item.second;
    }
  }
  this->Items.emplace_back(key, Json());
  return this->Items.back().second;
}

void Json::Append(const Json& value)
{
  this->Of = Array;
  this->Items.emplace_back("", value);
}

std::string Json::Write(int indent) const
{
  if (this->Of == Null)
  {
    return "null";
  }
  if (this->Of == Scalar)
  {
    return this->Text;
  }
  // Lists of scalars stay on a line.
  bool flat = this->Of == Array;
  for (const auto& item : this->Items)
  {
    flat = flat && item.second.Of != Object && item.second.Of != Array;
  }
  const std::string newline = flat ? "" : "\n" + std::string(2 * (indent + 1), ' ');
  std::string out = this->Of == Object ? "{" : "[";
  bool first = true;
  for (const auto& item : this->Items)
  {
    out += first ? newline : (flat ? ", " : "," + newline);
    first = false;
    out += this->Of == Object ? Quote(item.first) + ": " : "";
    out += item.second.Write(indent + 1);
  }
  if (!flat && !this->Items.empty())
  {
    out += "\n" + std::string(2 * indent, ' ');
  }
  return out + (this->Of == Object ? "}" : "]");
}

void PrepareFolder(const std::string& folder)
{
  for (std::size_t at = 1; at <= folder.size(); ++at)
  {
    if (at == folder.size() || folder[at] == '/')
    {
      const std::string part = folder.substr(0, at);
      if (mkdir(part.c_str(), 0777) != 0 && errno != EEXIST)
      {
        throw Error("--out: cannot make the folder '" + part + "': " + std::strerror(errno));
      }
    }
  }
  const std::string probe = folder + "/.light-volume-" + std::to_string(getpid());
  errno = 0;
  const bool ok = static_cast<bool>(std::ofstream(probe) << "x" << std::flush);
  const int reason = errno;
  std::remove(probe.c_str());
  if (!ok)
  {
    throw Error("--out: cannot write in '" + folder +
      "': " + (reason ? std::strerror(reason) : "unknown reason"));
  }
}

void WriteWhole(const std::string& path, const std::function<void(const std::string&)>& write)
{
  const std::string folder = Folder(path);
  const std::string partial =
    folder + ".partial-" + std::to_string(getpid()) + "-" + path.substr(folder.size());
  try
  {
    write(partial);
  }
  catch (...)
  {
    std::remove(partial.c_str());
    throw;
  }
  struct stat status;
  if (stat(partial.c_str(), &status) != 0 || status.st_size == 0 ||
    std::rename(partial.c_str(), path.c_str()) != 0)
  {
    const std::string reason = std::strerror(errno);
    std::remove(partial.c_str());
    throw Error("cannot write '" + path + "': " + reason);
  }
}

} // namespace lightvolume
