// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to vtkBucketedKBufferPass: OpenGL 4.3 that VTK 9.1 has no classes for
 * (vtkShader::Compute comes with 9.4), and what the pass asks OpenGL about the
 * picture that it draws into. A context is current in all of these.
 */
#ifndef KBufferResources_h
#define KBufferResources_h

#include "vtkLightTransportCompat.h"
#include "vtkType.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <array>
#include <string>
#include <vector>

class vtkOpenGLState;
class vtkShaderProgram;

namespace lighttransport
{
/** A buffer that shaders write as an image and read as a texture buffer. */
class TexelBuffer
{
public:
  TexelBuffer() = default;
  TexelBuffer(const TexelBuffer&) = delete;
  TexelBuffer& operator=(const TexelBuffer&) = delete;

  /** At least so many bytes; what was in it is lost where it grows. */
  void Reserve(vtkTypeInt64 bytes);
  void BindImage(GLuint unit, GLenum format);
  void BindTexture(vtkOpenGLState* state, int unit, GLenum format);
  void Upload(const std::vector<float>& values);
  void Fill(vtkTypeInt64 offset, vtkTypeInt64 bytes, GLuint value) const;
  GLuint Read(int index) const;
  void Release();

  vtkTypeInt64 Bytes = 0;

private:
  GLuint Id = 0;
  GLuint Texture = 0;
  GLuint Image = 0;
};

/** A compute shader. */
class ComputeProgram
{
public:
  ComputeProgram() = default;
  ComputeProgram(const ComputeProgram&) = delete;
  ComputeProgram& operator=(const ComputeProgram&) = delete;

  /** Makes it current; the compiler's log where it can't. Built where the source is new. */
  std::string Use(const std::string& source);
  GLint At(const char* name) const { return glGetUniformLocation(this->Id, name); }
  void Release();

private:
  GLuint Id = 0;
  std::string Source;
};

/** The uniforms of VTK's program, or of ours, that is current. */
class Uniforms
{
public:
  explicit Uniforms(vtkShaderProgram* program)
    : Vtk(program)
  {
  }
  explicit Uniforms(const ComputeProgram& program)
    : Own(&program)
  {
  }
  bool Has(const char* name) const;
  void Set(const char* name, int v) const;
  void Set(const char* name, float v) const;
  void Set(const char* name, const std::array<int, 2>& v) const;
  void Set(const char* name, const std::array<float, 2>& v) const;
  void Set(const char* name, const std::array<float, 4>& v) const;

private:
  vtkShaderProgram* Vtk = nullptr;
  const ComputeProgram* Own = nullptr;
};

/** What the picture is drawn into. */
struct PictureTarget
{

  bool plain = false; // 8 bits, one sample, linear: blended in the shader, rounded once

  static PictureTarget Bound();
};

/** The depth that is bound for reading. */
struct DepthSource
{
  int format = -1; // vtkTextureObject's name for it; -1: there is none
  bool stencil = false;

  static DepthSource Bound();
};

/** "#define name value" and a line's end. */
inline std::string define(const char* name, int value)
{
  return std::string("#define ") + name + " " + std::to_string(value) + "\n";
}
} // namespace lighttransport

#endif
