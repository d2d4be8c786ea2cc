/* What a picture can do without, found before it is drawn, and its pixels, read after.

   quick_renderer.py calls it; no pixel changes by it. Lengths are in m. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <mujoco/mujoco.h>

/* What `leave_out` says of what is left, ored. */
enum {
  FILLED = 1, /* a plane lies behind every pixel, so that no sky is seen */
  FIRST = 2,  /* that plane is the first geom, of one colour, and all else is in front of it */
  OPAQUE = 4  /* nothing shows what is behind it */
};

static const double IN_FRONT = 1e-3; /* how far from a plane is not in it */
static const double SKY = 0.6; /* MuJoCo draws it at 0.7 of the distance where all ends */

/* A camera: axes, and where the picture's edges are at the distance `near`. */
typedef struct {
  double position[3], forward[3], up[3], right[3];
  double left_edge, right_edge, bottom, top, near, far;
} View;

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void from_position(const View* view, const float position[3], double result[3]) {
  for (int i = 0; i < 3; i++) result[i] = position[i] - view->position[i];
}

/* The camera between those of two eyes, which is the one that is drawn from. */
static View between(const mjvGLCamera eyes[2], double aspect) {
  View v;
  for (int i = 0; i < 3; i++) {
    v.position[i] = 0.5 * ((double)eyes[0].pos[i] + eyes[1].pos[i]);
    v.forward[i] = eyes[0].forward[i];
    v.up[i] = eyes[0].up[i];
  }
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    v.right[i] = v.forward[j] * v.up[k] - v.forward[k] * v.up[j];
  }
  v.bottom = eyes[0].frustum_bottom;
  v.top = eyes[0].frustum_top;
  v.near = eyes[0].frustum_near;
  v.far = eyes[0].frustum_far;
  double center = 0.5 * ((double)eyes[0].frustum_center + eyes[1].frustum_center);
  double half = eyes[0].frustum_width;
  if (!half) half = 0.5 * aspect * (v.top - v.bottom);
  v.left_edge = center - half;
  v.right_edge = center + half;
  return v;
}

/* Half the edges of a box around a geom, along its axes; infinite where that is not known. */
static void half_extents(const mjvGeom* g, double half[3]) {
  for (int i = 0; i < 3; i++) {
    switch (g->type) {
      case mjGEOM_SPHERE:
      case mjGEOM_ELLIPSOID:
      case mjGEOM_CYLINDER:
      case mjGEOM_BOX:
        half[i] = g->size[i];
        break;
      case mjGEOM_CAPSULE:
        half[i] = i < 2 ? g->size[i] : (double)g->size[0] + g->size[2];
        break;
      case mjGEOM_MESH:
        half[i] = g->modelrbound > 0 ? g->modelrbound : INFINITY;
        break;
      default:
        half[i] = INFINITY;
    }
  }
}

/* How far a point is beyond the plane through the camera and an edge `at` of the picture. */
static double beyond(double sideways, double depth, double at, double near) {
  return (sideways * near - at * depth) / hypot(near, at);
}

static int outside(const View* v, const mjvGeom* g) {
  double half[3], p[3];
  half_extents(g, half);
  from_position(v, g->pos, p);
  double radius = sqrt(dot(half, half));
  double x = dot(p, v->right), y = dot(p, v->up), z = dot(p, v->forward);
  return z < v->near - radius || z > v->far + radius ||
         beyond(x, z, v->right_edge, v->near) > radius ||
         beyond(-x, z, -v->left_edge, v->near) > radius ||
         beyond(y, z, v->top, v->near) > radius || beyond(-y, z, -v->bottom, v->near) > radius;
}

static void axis(const mjvGeom* g, int i, double result[3]) {
  for (int k = 0; k < 3; k++) result[k] = g->mat[3 * k + i];
}

/* Whether a plane, seen from above, lies behind every pixel. */
static int fills(const View* v, const mjvGeom* plane) {
  double axes[3][3], origin[3], to_plane[3];
  from_position(v, plane->pos, to_plane);
  for (int i = 0; i < 3; i++) {
    axis(plane, i, axes[i]);
    origin[i] = -dot(to_plane, axes[i]);
  }
  for (int corner = 0; corner < 4; corner++) {
    double x = corner & 1 ? v->left_edge : v->right_edge, y = corner & 2 ? v->bottom : v->top;
    double ray[3];
    for (int i = 0; i < 3; i++) ray[i] = v->near * v->forward[i] + y * v->up[i] + x * v->right[i];
    double down = -dot(ray, axes[2]);
    if (!(origin[2] > 0.0 && down > 0.0)) return 0;
    double times = origin[2] / down;
    if (times * sqrt(dot(ray, ray)) >= SKY * v->far) return 0;
    for (int i = 0; i < 2; i++) {
      if (fabs(origin[i] + times * dot(ray, axes[i])) >= plane->size[i]) return 0;
    }
  }
  return 1;
}

/* Whether all of a geom is on the side of a plane where its normal points. */
static int in_front(const mjvGeom* plane, const mjvGeom* g) {
  double normal[3], half[3], height = -IN_FRONT;
  axis(plane, 2, normal);
  half_extents(g, half);
  for (int k = 0; k < 3; k++) height += normal[k] * ((double)g->pos[k] - plane->pos[k]);
  for (int i = 0; i < 3; i++) {
    double along[3];
    axis(g, i, along);
    height -= half[i] * fabs(dot(along, normal));
  }
  return height > 0.0; /* no, where nothing is known */
}

/* Let geoms outside of a picture be drawn as nothing; what is to be known of the others.

   Of a scene: `pos` of its first geom, how many it has, `pos` of its first camera; and the width
   of the picture per height. */
int leave_out(float* first_position, int64_t count, const float* camera, double aspect) {
  mjvGeom* geoms = (mjvGeom*)((char*)first_position - offsetof(mjvGeom, pos));
  const mjvGLCamera* eyes =
      (const mjvGLCamera*)((const char*)camera - offsetof(mjvGLCamera, pos));
  if (eyes[0].orthographic) return 0;
  View view = between(eyes, aspect);
  int said = OPAQUE;
  for (int64_t i = 0; i < count; i++) {
    if (geoms[i].type == mjGEOM_NONE) continue;
    if (outside(&view, &geoms[i])) {
      geoms[i].type = mjGEOM_NONE;
      continue;
    }
    if (geoms[i].rgba[3] < 1.0f) {
      said &= ~OPAQUE;
    } else if (geoms[i].type == mjGEOM_PLANE && fills(&view, &geoms[i])) {
      said |= i || geoms[i].texid >= 0 ? FILLED : FILLED | FIRST;
    }
  }
  for (int64_t i = 1; i < count && said & FIRST; i++) {
    if (geoms[i].type != mjGEOM_NONE && !in_front(&geoms[0], &geoms[i])) said &= ~FIRST;
  }
  return said;
}

static uint64_t without_alpha(uint64_t pair) {
  return (pair & 0xffffffu) | (pair >> 8 & 0xffffff000000u);
}

/* A picture (height, width, 3) from pixels (height, width) of red, green, blue and alpha, lowest
   row first, as GL reads them. With `fill`, where nothing was drawn (alpha is 0) is `background`,
   a colour like a pixel. */
void to_picture(
    const uint32_t* pixels, int64_t width, int64_t height, int fill, uint32_t background,
    uint8_t* picture) {
  const uint64_t drawn = fill ? 0x8000000080000000u : 0;
  const uint64_t behind = background | (uint64_t)background << 32;
  uint8_t four_behind[12];
  for (int i = 0; i < 4; i++) memcpy(four_behind + 3 * i, &background, 3);
  for (int64_t y = 0; y < height; y++) {
    const uint32_t* from = pixels + (height - 1 - y) * width;
    uint8_t* to = picture + 3 * y * width;
    int64_t x = 0;
    for (; x + 4 <= width; x += 4, to += 12) {
      uint64_t pairs[2];
      memcpy(pairs, from + x, sizeof pairs);
      if (fill && !(pairs[0] | pairs[1])) { /* most of them */
        memcpy(to, four_behind, 12);
        continue;
      }
      if ((pairs[0] & pairs[1] & drawn) != drawn) {
        for (int i = 0; i < 2; i++) {
          uint64_t mask = (pairs[i] >> 31 & 0x100000001u) * 0xffffffffu;
          pairs[i] = (pairs[i] & mask) | (behind & ~mask);
        }
      }
      uint64_t first = without_alpha(pairs[0]), second = without_alpha(pairs[1]);
      uint64_t low = first | second << 48;
      uint32_t high = (uint32_t)(second >> 16);
      memcpy(to, &low, 8);
      memcpy(to + 8, &high, 4);
    }
    for (; x < width; x++, to += 3) {
      uint32_t pixel = !fill || from[x] >> 31 ? from[x] : background;
      memcpy(to, &pixel, 3);
    }
  }
}
