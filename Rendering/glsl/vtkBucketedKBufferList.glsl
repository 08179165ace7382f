// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass: the nearest nodes of a pixel in order of depth, and the
// rest merged. Defined before: LT_ROOM >= k, the number of layers, a power of 2;
// LT_EACH: LT_ITEM(0) to LT_ITEM(LT_ROOM - 1); LT_NETWORK: LT_EXCHANGE(i, j) of a sorting
// network of LT_ROOM; vtkBucketedKBufferRead.glsl.
//
// Nothing here depends on the order in which nodes came: nodes of one depth are
// ordered by what they show, and are never split between list and tail; the tail's
// sums are integers.
//
// Loops hold as few fetches as can be: a SIMD machine runs both sides of an if. Fixed
// places of an array are fast everywhere, computed ones are not: thence the network. But it
// takes its time where there is nothing to sort too: only with LT_DENSE, for long lists.

uint ltDepths[LT_ROOM]; // bits of the depth in DC << 1 | thin: floats >= 0 sort as their bits do
uint ltNodes[LT_ROOM];
int ltCount = 0;

// The tail: sums over its fragments.
const float ltAlphaUnit = 16384.0;
const float ltColorUnit = 4096.0; // colours up to 16
const float ltLogUnit = 4096.0;
uint ltTailCount = 0u;
uint ltTailAlpha = 0u;         // sum of alpha
uvec3 ltTailColor = uvec3(0u); // sum of alpha c
uint ltTailLog = 0u;           // -log2 of the product of 1 - alpha

void ltMergeIntoTail(uint node)
{
  vec4 c = ltGetColor(node);
  ++ltTailCount;
  ltTailAlpha += uint(c.a * ltAlphaUnit + 0.5);
  ltTailColor += uvec3(c.a * min(c.rgb, vec3(16.0)) * ltColorUnit + 0.5);
  ltTailLog += uint(min(-log2(max(1.0 - c.a, 1e-7)), 23.0) * ltLogUnit + 0.5);
}

// The tail as one layer: RGBA, not premultiplied.
vec4 ltTailLayer()
{
  vec3 c = vec3(ltTailColor) / float(max(ltTailAlpha, 1u)) * (ltAlphaUnit / ltColorUnit);
  return vec4(c, 1.0 - exp2(-float(ltTailLog) / ltLogUnit));
}

bool ltContentBefore(uint a, uint b)
{
  vec4 ca = ltGetColor(a);
  vec4 cb = ltGetColor(b);
  if (ca.r != cb.r)
  {
    return ca.r < cb.r;
  }
  if (ca.g != cb.g)
  {
    return ca.g < cb.g;
  }
  if (ca.b != cb.b)
  {
    return ca.b < cb.b;
  }
  if (ca.a != cb.a)
  {
    return ca.a < cb.a;
  }
#if LT_STYLE
  return ltGetSurface(a).y < ltGetSurface(b).y;
#else
  return false;
#endif
}

void ltGather(uint pixel, int layers)
{
  uint head = ltGetHead(pixel);
  uint nearestLeft = 0xFFFFFFFFu; // of those that had no room
  bool tie = false;
  bool again = false; // see 4
  uint node = head;
#if LT_DENSE
  // 1. As many as there is room for, in order by a network.
#define LT_ITEM(i) ltDepths[i] = 0xFFFFFFFFu;
  LT_EACH
#undef LT_ITEM
  while (node != LT_NONE && ltCount < LT_ROOM)
  {
    uvec2 link = ltGetLink(node);
    ltDepths[ltCount] = link.y;
    ltNodes[ltCount] = node;
    ++ltCount;
    node = link.x;
  }
#define LT_EXCHANGE(i, j)                                                                          \
  {                                                                                                \
    uint a = ltDepths[i], b = ltDepths[j], m = ltNodes[i], n = ltNodes[j];                         \
    bool turn = b < a;                                                                             \
    ltDepths[i] = min(a, b);                                                                       \
    ltDepths[j] = max(a, b);                                                                       \
    ltNodes[i] = turn ? n : m;                                                                     \
    ltNodes[j] = turn ? m : n;                                                                     \
  }
  LT_NETWORK
#undef LT_EXCHANGE
  if (ltCount > layers)
  {
    nearestLeft = ltDepths[layers];
    ltCount = layers;
  }
  uint before = 0xFFFFFFFFu;
#define LT_ITEM(i)                                                                                 \
  tie = tie || (i < ltCount && ltDepths[i] == before);                                             \
  again = again || (i < ltCount && (ltDepths[i] & before & 1u) == 1u);                             \
  before = ltDepths[i];
  LT_EACH
#undef LT_ITEM
#endif

  // The nearest by depth, by insertion: short lists, and what the network has left.
  while (node != LT_NONE)
  {
    uvec2 link = ltGetLink(node);
    uint depth = link.y;
    if (ltCount == layers)
    {
      --ltCount;
      uint last = ltDepths[ltCount];
      nearestLeft = min(nearestLeft, max(last, depth));
      if (depth >= last)
      {
        depth = last;
        node = ltNodes[ltCount];
      }
    }
    int i = ltCount;
    while (i > 0 && depth < ltDepths[i - 1])
    {
      ltDepths[i] = ltDepths[i - 1];
      ltNodes[i] = ltNodes[i - 1];
      --i;
    }
    tie = tie || (i > 0 && depth == ltDepths[i - 1]);
    again = again || (depth & 1u) == 1u;
    ltDepths[i] = depth;
    ltNodes[i] = node;
    ++ltCount;
    node = link.x;
  }

  // 2. The tail: all that are not nearer than the nearest left out.
  if (nearestLeft != 0xFFFFFFFFu)
  {
    while (ltCount > 0 && ltDepths[ltCount - 1] == nearestLeft)
    {
      --ltCount;
    }
  }
  for (node = nearestLeft == 0xFFFFFFFFu ? LT_NONE : head; node != LT_NONE;)
  {
    uvec2 link = ltGetLink(node);
    if (link.y >= nearestLeft)
    {
      ltMergeIntoTail(node);
    }
    node = link.x;
  }

  // 3. Equal depths by content.
  int count = tie ? ltCount : 0;
  for (int j = 1; j < count; ++j)
  {
    node = ltNodes[j];
    int i = j;
    while (i > 0 && ltDepths[i - 1] == ltDepths[j] && ltContentBefore(node, ltNodes[i - 1]))
    {
      ltNodes[i] = ltNodes[i - 1];
      --i;
    }
    ltNodes[i] = node;
  }

  // 4. VTK draws a wireframe's edge for each of its triangles, a point likewise: the
  // same fragment again and again, but for the rounding of its depth.
  if (again)
  {
    count = 0;
    for (int j = 0; j < ltCount; ++j)
    {
      uint depth = ltDepths[j];
      uint kept = ltDepths[max(count - 1, 0)];
      bool same = count > 0 && (depth & kept & 1u) == 1u && depth - kept <= 8u;
      if (!same)
      {
        ltDepths[count] = depth;
        ltNodes[count] = ltNodes[j];
        ++count;
      }
    }
    ltCount = count;
  }
}
