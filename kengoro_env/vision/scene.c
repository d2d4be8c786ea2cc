/* What of a scene a picture can do without, or with less of, found before it is drawn.

   quick_renderer.py calls it. Lengths are in m. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include <mujoco/mujoco.h>

/* What `leave_out` says of what is left, ored. */
enum {
  FILLED = 1, /* a plane lies behind every pixel, so that no sky is seen */
  FIRST = 2,  /* that plane is the first geom, of one colour, all else is in front of it, and
                 somewhere nothing is */
  OPAQUE = 4  /* nothing shows what is behind it */
};

static const double IN_FRONT = 1e-3; /* how far from a plane is not in it */
static const double SKY = 0.6; /* MuJoCo draws it at 0.7 of the distance where all ends */
static const double WITHIN = 0.5; /* of the radius' square: faces of few corners come closer */
static const float THIN = 1e-4f; /* half the thickness of a plane that is drawn as a box */
enum { ACROSS = 8, DOWN = 6 }; /* how many pixels are asked whether only the plane is seen there */

/* What a scene is drawn to. */
typedef struct {
  int64_t width; /* [pixels] */
  int64_t height;
  float* geom; /* `pos` of the scene's first one, as of camera and light */
  float* camera;
  float* light;
  const uint8_t* spooled; /* of each tendon, whether it has a spool */
  /* Told with FIRST: a pixel, counted from the lowest row, where only the first geom is seen, and
     what of it. */
  int64_t pixel;
  float point[3];
} Canvas;

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

/* Whether a camera is well within a round geom, whose faces are not seen from inside. */
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

/* From a camera through a point of its picture at the distance `near`. */
static void ray_through(const View* v, double x, double y, double ray[3]) {
  for (int i = 0; i < 3; i++) ray[i] = v->near * v->forward[i] + y * v->up[i] + x * v->right[i];
}

/* How high a camera is above a plane. */
static double height_above(const View* v, const mjvGeom* plane) {
  double normal[3], to_plane[3];
  axis(plane, 2, normal);
  from_position(v, plane->pos, to_plane);
  return -dot(to_plane, normal);
}

/* How often a ray fits in before the plane that it comes to from above; infinite if to none. */
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

/* Whether a plane has one colour under lights: if all shine from afar, and none is mirrored. */
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

/* Look for a pixel where only the first geom, a plane that fills the picture, is seen. */
static int find_bare(const View* v, const mjvGeom* geoms, int64_t count, Canvas* canvas) {
  int64_t width = canvas->width, height = canvas->height;
  for (int spot = 0; spot < ACROSS * DOWN; spot++) {
    int64_t column = width * (2 * (spot % ACROSS) + 1) / (2 * ACROSS);
    int64_t row = height * (2 * (spot / ACROSS) + 1) / (2 * DOWN), i = 1;
    double ray[3];
    ray_through(
        v, v->left_edge + (v->right_edge - v->left_edge) * (column + 0.5) / width,
        v->bottom + (v->top - v->bottom) * (row + 0.5) / height, ray);
    while (i < count && (geoms[i].type == mjGEOM_NONE || !meets(v, ray, &geoms[i]))) i++;
    if (i < count) continue;
    double times = times_to(v, &geoms[0], ray);
    canvas->pixel = row * width + column;
    for (int k = 0; k < 3; k++) canvas->point[k] = (float)(v->position[k] + times * ray[k]);
    return 1;
  }
  return 0;
}

/* Let geoms outside of a picture be drawn as nothing; what is to be known of the others. */
static int leave_out(
    const View* view, mjvGeom* geoms, int64_t geom_count, const mjvLight* lights,
    int64_t light_count, Canvas* canvas) {
  int said = OPAQUE;
  for (int64_t i = 0; i < geom_count; i++) {
    if (geoms[i].type == mjGEOM_NONE) continue;
    if (outside(view, &geoms[i]) || within(view, &geoms[i])) {
      geoms[i].type = mjGEOM_NONE;
      continue;
    }
    if (geoms[i].rgba[3] < 1.0f) {
      said &= ~OPAQUE;
    } else if (geoms[i].type == mjGEOM_PLANE && fills(view, &geoms[i])) {
      said |= i || geoms[i].texid >= 0 ? FILLED : FILLED | FIRST;
    }
  }
  if (!(said & FIRST)) return said;
  for (int64_t i = 1; i < geom_count; i++) {
    if (geoms[i].type != mjGEOM_NONE && !in_front(&geoms[0], &geoms[i])) return said & ~FIRST;
  }
  if (!evenly_lit(&geoms[0], lights, light_count)) return said & ~FIRST;
  return find_bare(view, geoms, geom_count, canvas) ? said : said & ~FIRST;
}

/* Have planes and wires drawn as simplified.py says. */
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

/* Make a scene of some geoms and lights ready to be drawn; what is to be known of what is left. */
int prepare(Canvas* canvas, int64_t geom_count, int64_t light_count) {
  mjvGeom* geoms = (mjvGeom*)((char*)canvas->geom - offsetof(mjvGeom, pos));
  const mjvLight* lights = (mjvLight*)((char*)canvas->light - offsetof(mjvLight, pos));
  const mjvGLCamera* eyes = (mjvGLCamera*)((char*)canvas->camera - offsetof(mjvGLCamera, pos));
  View view = between(eyes, (double)canvas->width / canvas->height);
  int said = 0;
  if (!eyes[0].orthographic) {
    said = leave_out(&view, geoms, geom_count, lights, light_count, canvas);
  }
  simplify(&view, geoms, geom_count, canvas->spooled);
  return said;
}
