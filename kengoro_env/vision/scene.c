/* Simplifies a scene before it is rendered: leaves out geoms that are not visible, and finds out
   whether the background has one colour.

   Called by quick_renderer.py. Lengths are in m. A geom of the type mjGEOM_NONE is not rendered. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include <mujoco/mujoco.h>

/* Flags of what remains to be rendered. */
enum {
  FILLED = 1, /* a plane lies behind every pixel, so that no sky is seen */
  FIRST = 2,  /* that plane is the first geom and has one colour, all other geoms are in front of
                 it, and some pixel shows nothing else */
  OPAQUE = 4  /* no geom is transparent */
};

static const double IN_FRONT = 1e-3; /* distance from a plane at which a geom is in front of it */
static const double SKY = 0.6; /* part of the far distance; MuJoCo renders the sky at 0.7 of it */
static const double WITHIN = 0.5; /* part of the radius squared: flat faces lie inside */
static const double ROUNDING = 1e-5; /* distance from the image beyond which a mesh is outside */
static const float THIN = 1e-4f; /* half the thickness of the box of a plane */
enum { ACROSS = 8, DOWN = 6 }; /* number of pixels that are tested for showing only the plane */

/* Where a scene is rendered to. */
typedef struct {
  int64_t width; /* [pixels] */
  int64_t height;
  float* geom; /* `pos` of the first geom; likewise of camera and light */
  float* camera;
  float* light;
  const uint8_t* spooled; /* (ntendon,) whether a tendon has a spool */
  const float* vertex; /* (nmeshvert, 3) of all meshes; the first of each mesh, and their number */
  const int* first_vertex;
  const int* vertex_count;
  /* Written with FIRST: a pixel, counted from the lowest row, that shows only the first geom, and
     the point of the geom that it shows. */
  int64_t pixel;
  float point[3];
} Canvas;

/* A camera: its axes, and the edges of the image at the distance `near`. */
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

/* The camera that is rendered from: the mean of the cameras of two eyes. */
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

/* Half the edges of a box around a geom, along its axes; infinite if unknown. */
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

/* Distance of a point beyond the plane through the camera and an edge `at` of the image. */
static double beyond(double sideways, double depth, double at, double near) {
  return (sideways * near - at * depth) / hypot(near, at);
}

/* Whether a mesh is nearer than the image, or beyond one of its edges, with all its vertices. */
static int mesh_outside(const View* v, const mjvGeom* g, const Canvas* canvas) {
  const double sides[5][3] = {/* directions out of the image, along right, up and forward */
                              {0, 0, -1},
                              {v->near, 0, -v->right_edge},
                              {-v->near, 0, v->left_edge},
                              {0, v->near, -v->top},
                              {0, -v->near, v->bottom}};
  const int mesh = g->dataid / 2, count = canvas->vertex_count[mesh];
  const float* vertex = canvas->vertex + 3 * (size_t)canvas->first_vertex[mesh];
  double p[3];
  from_position(v, g->pos, p);
  for (int side = 0; side < 5; side++) {
    double size = sqrt(dot(sides[side], sides[side])), out[3], along[3];
    for (int i = 0; i < 3; i++) {
      out[i] = (sides[side][0] * v->right[i] + sides[side][1] * v->up[i] +
                sides[side][2] * v->forward[i]) /
               size;
    }
    for (int k = 0; k < 3; k++) {
      along[k] = g->mat[k] * out[0] + g->mat[3 + k] * out[1] + g->mat[6 + k] * out[2];
    }
    double beyond_edge = dot(p, out) + (side ? 0 : v->near) - ROUNDING;
    int n = 0;
    for (const float* at = vertex; n < count; n++, at += 3) {
      if (beyond_edge + along[0] * at[0] + along[1] * at[1] + along[2] * at[2] <= 0) break;
    }
    if (n == count) return 1;
  }
  return 0;
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

/* Whether a camera is inside a round geom, whose faces are not visible from inside. */
static int within(const View* v, const mjvGeom* g) {
  double p[3], sum = 0.0;
  if (g->type != mjGEOM_SPHERE && g->type != mjGEOM_ELLIPSOID) return 0;
  from_position(v, g->pos, p);
  for (int i = 0; i < 3; i++) {
    double along[3];
    axis(g, i, along);
    double at = dot(p, along) / g->size[i];
    sum += at * at;
  }
  return sum < WITHIN;
}

/* Ray from a camera through a point of its image at the distance `near`. */
static void ray_through(const View* v, double x, double y, double ray[3]) {
  for (int i = 0; i < 3; i++) ray[i] = v->near * v->forward[i] + y * v->up[i] + x * v->right[i];
}

/* Height of a camera above a plane. */
static double height_above(const View* v, const mjvGeom* plane) {
  double normal[3], to_plane[3];
  axis(plane, 2, normal);
  from_position(v, plane->pos, to_plane);
  return -dot(to_plane, normal);
}

/* Multiple of a ray at which it meets a plane from above; infinite if it does not. */
static double times_to(const View* v, const mjvGeom* plane, const double ray[3]) {
  double normal[3], height = height_above(v, plane);
  axis(plane, 2, normal);
  double down = -dot(ray, normal);
  return height > 0.0 && down > 0.0 ? height / down : INFINITY;
}

/* Whether a plane, seen from above, lies behind every pixel. */
static int fills(const View* v, const mjvGeom* plane) {
  double to_plane[3];
  from_position(v, plane->pos, to_plane);
  for (int corner = 0; corner < 4; corner++) {
    double ray[3];
    ray_through(
        v, corner & 1 ? v->left_edge : v->right_edge, corner & 2 ? v->bottom : v->top, ray);
    double times = times_to(v, plane, ray);
    if (!(times * sqrt(dot(ray, ray)) < SKY * v->far)) return 0;
    for (int i = 0; i < 2; i++) {
      double along[3];
      axis(plane, i, along);
      if (fabs(times * dot(ray, along) - dot(to_plane, along)) >= plane->size[i]) return 0;
    }
  }
  return 1;
}

/* Whether a geom lies entirely on the side of a plane that its normal points to. */
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
  return height > 0.0; /* false for unknown extents */
}

/* Whether a plane has one colour under some lights: all are directional, without highlights. */
static int evenly_lit(const mjvGeom* plane, const mjvLight* lights, int64_t count) {
  for (int64_t i = 0; i < count; i++) {
    const float* shine = lights[i].specular;
    if (lights[i].type != mjLIGHT_DIRECTIONAL) return 0;
    if (plane->specular > 0 && (shine[0] > 0 || shine[1] > 0 || shine[2] > 0)) return 0;
  }
  return 1;
}

/* Whether a ray comes near a geom. */
static int meets(const View* v, const double ray[3], const mjvGeom* g) {
  double half[3], p[3];
  half_extents(g, half);
  from_position(v, g->pos, p);
  double along = dot(p, ray);
  return !(dot(p, p) - along * along / dot(ray, ray) > dot(half, half));
}

/* Find a pixel that shows only the first geom, a plane that fills the image. */
static int find_bare(const View* v, const mjvGeom* geoms, int64_t count, Canvas* canvas) {
  int64_t width = canvas->width, height = canvas->height;
  for (int k = 0; k < ACROSS * DOWN; k++) {
    int64_t column = width * (2 * (k % ACROSS) + 1) / (2 * ACROSS);
    int64_t row = height * (2 * (k / ACROSS) + 1) / (2 * DOWN), i = 1;
    double ray[3];
    ray_through(
        v, v->left_edge + (v->right_edge - v->left_edge) * (column + 0.5) / width,
        v->bottom + (v->top - v->bottom) * (row + 0.5) / height, ray);
    while (i < count && (geoms[i].type == mjGEOM_NONE || !meets(v, ray, &geoms[i]))) i++;
    if (i < count) continue;
    double times = times_to(v, &geoms[0], ray);
    canvas->pixel = row * width + column;
    for (int j = 0; j < 3; j++) canvas->point[j] = (float)(v->position[j] + times * ray[j]);
    return 1;
  }
  return 0;
}

/* Leave out geoms that are not visible. Returns the flags of the others. */
static int leave_out(
    const View* view, mjvGeom* geoms, int64_t geom_count, const mjvLight* lights,
    int64_t light_count, Canvas* canvas) {
  int flags = OPAQUE;
  for (int64_t i = 0; i < geom_count; i++) {
    if (geoms[i].type == mjGEOM_NONE) continue;
    int is_mesh = geoms[i].type == mjGEOM_MESH && geoms[i].dataid >= 0;
    if (outside(view, &geoms[i]) || within(view, &geoms[i]) ||
        (is_mesh && mesh_outside(view, &geoms[i], canvas))) {
      geoms[i].type = mjGEOM_NONE;
      continue;
    }
    if (geoms[i].rgba[3] < 1.0f) {
      flags &= ~OPAQUE;
    } else if (geoms[i].type == mjGEOM_PLANE && fills(view, &geoms[i])) {
      flags |= i || geoms[i].texid >= 0 ? FILLED : FILLED | FIRST;
    }
  }
  if (!(flags & FIRST)) return flags;
  for (int64_t i = 1; i < geom_count; i++) {
    if (geoms[i].type != mjGEOM_NONE && !in_front(&geoms[0], &geoms[i])) return flags & ~FIRST;
  }
  if (!evenly_lit(&geoms[0], lights, light_count)) return flags & ~FIRST;
  return find_bare(view, geoms, geom_count, canvas) ? flags : flags & ~FIRST;
}

/* Simplify planes and tendons as simplified_scene.py does. */
static void simplify(const View* view, mjvGeom* geoms, int64_t count, const uint8_t* spooled) {
  int last = -1;
  for (mjvGeom* g = geoms; g < geoms + count; g++) {
    if (g->objtype == mjOBJ_TENDON) {
      if (g->objid != last && spooled[g->objid]) {
        g->type = mjGEOM_NONE;
      } else if (g->type != mjGEOM_NONE) {
        g->type = mjGEOM_BOX;
      }
      last = g->objid;
    } else if (g->type == mjGEOM_PLANE && fminf(g->size[0], g->size[1]) > 0 &&
               height_above(view, g) > 0) {
      g->type = mjGEOM_BOX;
      g->size[2] = THIN;
    }
  }
}

/* Leave out and simplify geoms of a scene. Returns the flags of those that remain. */
int prepare(Canvas* canvas, int64_t geom_count, int64_t light_count) {
  mjvGeom* geoms = (mjvGeom*)((char*)canvas->geom - offsetof(mjvGeom, pos));
  const mjvLight* lights = (mjvLight*)((char*)canvas->light - offsetof(mjvLight, pos));
  const mjvGLCamera* eyes = (mjvGLCamera*)((char*)canvas->camera - offsetof(mjvGLCamera, pos));
  View view = between(eyes, (double)canvas->width / canvas->height);
  int flags = 0;
  if (!eyes[0].orthographic) {
    flags = leave_out(&view, geoms, geom_count, lights, light_count, canvas);
  }
  simplify(&view, geoms, geom_count, canvas->spooled);
  return flags;
}
