// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "KBufferResources.h"

#include "vtkOpenGLState.h"
#include "vtkShaderProgram.h"
#include "vtkTextureObject.h"

namespace lighttransport
{
//------------------------------------------------------------------------------
void TexelBuffer::Reserve(vtkTypeInt64 bytes)
{
  if (this->Id == 0)
  {
    glGenBuffers(1, &this->Id);
  }
  if (this->Bytes < bytes)
  {
    glBindBuffer(GL_TEXTURE_BUFFER, this->Id);
    glBufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
    this->Bytes = bytes;
  }
}

//------------------------------------------------------------------------------
void TexelBuffer::BindTexture(vtkOpenGLState* state, int unit, GLenum format)
{
  if (this->Texture == 0)
  {
    glGenTextures(1, &this->Texture);
  }
  state->vtkglActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  glBindTexture(GL_TEXTURE_BUFFER, this->Texture);
  glTexBuffer(GL_TEXTURE_BUFFER, format, this->Id);
}

//------------------------------------------------------------------------------
void TexelBuffer::BindImage(GLuint unit, GLenum format)
{
  if (this->Image == 0)
  {
    glGenTextures(1, &this->Image);
  }
  glBindTexture(GL_TEXTURE_BUFFER, this->Image);
  glTexBuffer(GL_TEXTURE_BUFFER, format, this->Id);
  glBindTexture(GL_TEXTURE_BUFFER, 0);
  glBindImageTexture(unit, this->Image, 0, GL_FALSE, 0, GL_READ_WRITE, format);
}

//------------------------------------------------------------------------------
void TexelBuffer::Upload(const std::vector<float>& values)
{
  const auto bytes = static_cast<GLsizeiptr>(values.size() * sizeof(float));
  this->Reserve(bytes);
  glBindBuffer(GL_TEXTURE_BUFFER, this->Id);
  glBufferSubData(GL_TEXTURE_BUFFER, 0, bytes, values.data());
}

//------------------------------------------------------------------------------
void TexelBuffer::Fill(vtkTypeInt64 offset, vtkTypeInt64 bytes, GLuint value) const
{
  glBindBuffer(GL_TEXTURE_BUFFER, this->Id);
  glClearBufferSubData(GL_TEXTURE_BUFFER, GL_R32UI, static_cast<GLintptr>(offset),
    static_cast<GLsizeiptr>(bytes), GL_RED_INTEGER, GL_UNSIGNED_INT, &value);
}

//------------------------------------------------------------------------------
GLuint TexelBuffer::Read(int index) const
{
  GLuint value = 0;
  glBindBuffer(GL_TEXTURE_BUFFER, this->Id);
  glGetBufferSubData(GL_TEXTURE_BUFFER, index * GLintptr(sizeof(GLuint)), sizeof(GLuint), &value);
  return value;
}

//------------------------------------------------------------------------------
void TexelBuffer::Release()
{
  if (this->Id != 0)
  {
    glDeleteBuffers(1, &this->Id);
  }
  for (GLuint* texture : { &this->Texture, &this->Image })
  {
    if (*texture != 0)
    {
      glDeleteTextures(1, texture);
      *texture = 0;
    }
  }
  this->Id = 0;
  this->Bytes = 0;
}

//------------------------------------------------------------------------------
std::string ComputeProgram::Use(const std::string& source)
{
  if (this->Id == 0 || this->Source != source)
  {
    this->Release();
    this->Source = source;
    const GLuint shader = glCreateShader(GL_COMPUTE_SHADER);
    const char* text = source.c_str();
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    GLint good = GL_FALSE;
    std::array<GLchar, 2048> log{};
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    if (!good)
    {
      glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
      glDeleteShader(shader);
      return std::string("does not compile: ") + log.data();
    }
    this->Id = glCreateProgram();
    glAttachShader(this->Id, shader);
    glLinkProgram(this->Id);
    glDeleteShader(shader);
    glGetProgramiv(this->Id, GL_LINK_STATUS, &good);
    if (!good)
    {
      glGetProgramInfoLog(this->Id, static_cast<GLsizei>(log.size()), nullptr, log.data());
      this->Release();
      return std::string("does not link: ") + log.data();
    }
  }
  glUseProgram(this->Id);
  return std::string();
}

//------------------------------------------------------------------------------
void ComputeProgram::Release()
{
  if (this->Id != 0)
  {
    glDeleteProgram(this->Id);
  }
  this->Id = 0;
}

//------------------------------------------------------------------------------
bool Uniforms::Has(const char* name) const
{
  return this->Vtk ? this->Vtk->IsUniformUsed(name) : this->Own->At(name) >= 0;
}

//------------------------------------------------------------------------------
void Uniforms::Set(const char* name, int v) const
{
  this->Vtk ? (void)this->Vtk->SetUniformi(name, v) : glUniform1i(this->Own->At(name), v);
}

//------------------------------------------------------------------------------
void Uniforms::Set(const char* name, float v) const
{
  this->Vtk ? (void)this->Vtk->SetUniformf(name, v) : glUniform1f(this->Own->At(name), v);
}

//------------------------------------------------------------------------------
void Uniforms::Set(const char* name, const std::array<int, 2>& v) const
{
  this->Vtk ? (void)this->Vtk->SetUniform2i(name, v.data())
            : glUniform2iv(this->Own->At(name), 1, v.data());
}

//------------------------------------------------------------------------------
void Uniforms::Set(const char* name, const std::array<float, 2>& v) const
{
  this->Vtk ? (void)this->Vtk->SetUniform2f(name, v.data())
            : glUniform2fv(this->Own->At(name), 1, v.data());
}

//------------------------------------------------------------------------------
void Uniforms::Set(const char* name, const std::array<float, 4>& v) const
{
  this->Vtk ? (void)this->Vtk->SetUniform4f(name, v.data())
            : glUniform4fv(this->Own->At(name), 1, v.data());
}

//------------------------------------------------------------------------------
PictureTarget PictureTarget::Bound()
{
  PictureTarget target;
  GLint object = 0;
  GLint buffer = 0;
  glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &object);
  glGetIntegerv(GL_DRAW_BUFFER0, &buffer);
  if (object == 0 || buffer < GL_COLOR_ATTACHMENT0 || buffer > GL_COLOR_ATTACHMENT0 + 15)
  {
    return target;
  }
  const auto attachment = static_cast<GLenum>(buffer);
  const auto ask = [attachment](GLenum what)
  {
    GLint value = 0;
    glGetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, attachment, what, &value);
    return value;
  };
  if (ask(GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE)
  {
    return target;
  }
  GLint samples = 0;
  GLint readObject = 0;
  glGetIntegerv(GL_SAMPLE_BUFFERS, &samples);
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &readObject);

  target.plain = ask(GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE) != GL_FLOAT && samples == 0 &&
    readObject == object && ask(GL_FRAMEBUFFER_ATTACHMENT_RED_SIZE) == 8 &&
    ask(GL_FRAMEBUFFER_ATTACHMENT_ALPHA_SIZE) == 8 && glIsEnabled(GL_FRAMEBUFFER_SRGB) == GL_FALSE;
  return target;
}

//------------------------------------------------------------------------------
DepthSource DepthSource::Bound()
{
  DepthSource source;
  GLint object = 0;
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &object);
  const auto ask = [](GLenum attachment, GLenum what)
  {
    GLint value = 0;
    glGetFramebufferAttachmentParameteriv(GL_READ_FRAMEBUFFER, attachment, what, &value);
    return value;
  };
  const GLenum depth = object == 0 ? GL_DEPTH : GL_DEPTH_ATTACHMENT;
  const GLenum stencil = object == 0 ? GL_STENCIL : GL_STENCIL_ATTACHMENT;
  if (ask(depth, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE)
  {
    return source;
  }
  const GLint bits = ask(depth, GL_FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE);
  source.format = bits <= 16 ? vtkTextureObject::Fixed16
                             : (bits <= 24 ? vtkTextureObject::Fixed24 : vtkTextureObject::Fixed32);
  if (ask(depth, GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE) == GL_FLOAT)
  {
    source.format = vtkTextureObject::Float32;
  }
  source.stencil = ask(stencil, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) != GL_NONE &&
    ask(stencil, GL_FRAMEBUFFER_ATTACHMENT_STENCIL_SIZE) > 0;
  return source;
}
} // namespace lighttransport
