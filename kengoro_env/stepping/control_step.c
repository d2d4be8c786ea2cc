/* Control steps of robots in C: the computation of `NumpySteps` (numpy_steps.py), but faster.

   The results have the bits of NumPy's: operations are the same and in the same order, and sums run
   from the first entry to the last. The compiler must therefore not contract a product and a sum
   into one fused operation (-ffp-contract=off). c_compiler.py compiles this file on first use, and
   compiled_steps.py fills in the structures.

   m is the number of muscles, n the number of joints that muscles actuate. Pointers lead to the
   memory of NumPy or MuJoCo arrays. Lengths are in m, tensions in N, angles in rad. */

#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <sched.h>
#include <setjmp.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <mujoco/mujoco.h>

/* Dry friction in proportion to actuator forces, in one array of the model (friction.py). */
typedef struct {
  int64_t count;           /* 0: no friction of this kind */
  double* loss;            /* (count,) friction losses in the model */
  const int64_t* actuator; /* (count,) actuator whose force sets the friction */
  const double* ratio;     /* (count,) friction per force */
  const double* constant;  /* (count,) friction without force, or NULL for 0 */
} Friction;

/* One robot. The Python side has the same fields in the same order (step_structures.py). */
typedef struct {
  mjModel* model;
  mjData* data;
  int64_t substeps; /* physics time steps in a control period */
  int64_t muscles;  /* m */
  int64_t joints;   /* n */
  int64_t fingers;  /* actuator of the fingers; -1: the robot has no fingers */
  int64_t grip;     /* site of the grip point */

  /* The object that the hand is to lift (tracked_object.py). */
  int64_t object; /* its body; -1: no object */
  int64_t object_geom;
  const int64_t* toucher; /* (ngeom + 1,) flag of the body part of each geom; last: not a geom */
  double* object_pose;    /* (4, 4) in the world; the last row is not written */

  /* Motors (motors.py, muscle_law.py), (m,). */
  const int64_t* tendon;    /* index of the tendon */
  const int64_t* actuator;  /* index of the actuator */
  const int64_t* spool;     /* index of the spool in qpos; -1: the tendon does not stretch */
  const double* drum;       /* length paid out when the spool stands at zero */
  const double* elongation; /* permanent elongation */
  const double* stiffness;  /* K_stiff [N/m] */
  const double* bias;       /* T_bias */
  const double* limit;      /* T_max */
  const double* damping;    /* viscous friction of the motor [N s/m] */
  const double* polynomial; /* (3, m) coefficients of the tendon's spring force */
  Friction friction[2];     /* of tendons, and of joints */

  /* Sensors (sensors.py), (m,); NULL where the sensor has no such error. */
  const double* length_offset;
  const double* length_noise;
  const double* length_quantum;
  const double* tension_offset;
  const double* tension_noise;
  double* noise; /* standard normal samples: for lengths, then for tensions, if noisy */
  void* random;  /* NumPy's bit generator of the noise */

  const double* zero;      /* (m,) length paid out in the zero posture */
  const int64_t* position; /* (n,) indices of the joints in qpos */
  double* left_at;         /* (nq + nv,) positions and velocities at the end of the last step */

  /* Bounds of lengths and tensions (spaces.py), (m,). */
  const double* half;
  const double* middle;
  const double* low;
  const double* high;
  const double* most_tension;

  const double* action; /* (m + 1,) in [-1, 1]; the last entry is for the fingers */
  const double* goal;   /* (n,) joint angles to reach, or NULL */

  /* Reward and success of reaching the goal (reach_reward.py). */
  const double* until; /* time of the next goal */
  double tolerance;
  double reward_scale;
  double effort;
  double effort_scale;

  /* Results (report.py). Pointers without a size lead to one number. */
  double* target; /* (m,) target lengths that the action commanded */
  double* lengths;        /* (m,) sensed, within bounds */
  double* tensions;       /* (m,) sensed, within bounds */
  double* slack_paid_out; /* (m,) length paid out beyond the path */
  double* slack_target;   /* (m,) target length beyond the true length */
  double* joint_angles;   /* (n,) */
  double* hand_pose;      /* (4, 4) of the grip in the world; the last row is not written */
  double* error;          /* mean square error of the joint angles */
  double* tension;        /* mean tension */
  double* time;
  double* distance; /* of the object from the grip */
  double* touched;  /* flags of the body parts that touch the object */
  double* reward;   /* NULL: the step is not judged, and the next results are not written */
  uint8_t* success;
  uint8_t* due; /* whether the time of the next goal has come */
  char reason[256]; /* message of an error of MuJoCo */
} Step;

/* Outcomes of a step, from best to worst. */
enum { DONE, INVALID, DIVERGED, BROKEN };

/* An error of MuJoCo ends the process unless a log handler leaves by longjmp. MuJoCo's Python
   bindings catch errors through the same two functions. */
extern mjfLogHandler _mjPRIVATE_setTlsLogHandler(mjfLogHandler handler);
extern mjfLogHandler _mjPRIVATE_getGlobalLogHandler(void);

static _Thread_local jmp_buf before;
static _Thread_local char* reason;

size_t size_of_step(void) { return sizeof(Step); }

static void catch_error(const mjLogMessage* message) {
  if (message->level < mjLOG_ERROR) {
    _mjPRIVATE_getGlobalLogHandler()(message);
    return;
  }
  snprintf(
      reason, sizeof ((Step*)0)->reason, "%s%s%s", message->func ? message->func : "",
      message->func ? ": " : "", message->subject);
  longjmp(before, 1);
}

static double at_least(double value, double least) { return value < least ? least : value; }

static double at_most(double value, double most) { return value > most ? most : value; }

/* Largest entry of an action, which counts as 1: as LARGEST of spaces.py. */
static const double LARGEST = 1.0 + 1e-6;

static double entry(const Step* s, int64_t i) { return at_most(at_least(s->action[i], -1.0), 1.0); }

static int is_valid(const Step* s) {
  int64_t entries = s->muscles + (s->fingers >= 0);
  for (int64_t i = 0; i < entries; i++) {
    if (!(fabs(s->action[i]) <= LARGEST)) return 0;
  }
  return 1;
}

/* Command the motors to the target lengths of the action (Robot.step, Motors.command). */
static void command(const Step* s) {
  double* ctrl = s->data->ctrl;
  for (int64_t i = 0; i < s->muscles; i++) {
    s->target[i] = entry(s, i) * s->half[i] + s->middle[i];
    double paid_out = s->target[i] + s->zero[i];
    if (s->length_offset) paid_out -= s->length_offset[i];
    ctrl[s->actuator[i]] = s->spool[i] < 0 ? paid_out + s->elongation[i] : paid_out;
  }
  if (s->fingers >= 0) ctrl[s->fingers] = entry(s, s->muscles);
}

static void update_friction(const Step* s) {
  for (int k = 0; k < 2; k++) {
    const Friction* f = &s->friction[k];
    for (int64_t i = 0; i < f->count; i++) {
      double loss = s->data->actuator_force[f->actuator[i]] * f->ratio[i];
      f->loss[i] = f->constant ? loss + f->constant[i] : loss;
    }
  }
}

/* Step the physics for one control period (Robot._advance). */
static int advance(const Step* s) {
  const mjModel* model = s->model;
  mjData* data = s->data;
  size_t positions = model->nq * sizeof(double), velocities = model->nv * sizeof(double);
  int64_t left = s->substeps;
  if (!memcmp(s->left_at, data->qpos, positions) &&
      !memcmp(s->left_at + model->nq, data->qvel, velocities)) {
    mj_fwdVelocity(model, data);
    mj_step2(model, data);
    left--;
  }
  for (; left > 0; left--) {
    update_friction(s);
    mj_step(model, data);
  }
  update_friction(s);

  double energy = 0.0;
  for (int64_t i = 0; i < model->nv; i++) energy += data->qvel[i] * data->qvel[i];
  if (!isfinite(energy)) return DIVERGED;
  for (int k = mjWARN_BADQPOS; k <= mjWARN_BADCTRL; k++) {
    if (data->warning[k].number) return DIVERGED;
  }
  mj_fwdPosition(model, data);
  memcpy(s->left_at, data->qpos, positions);
  memcpy(s->left_at + model->nq, data->qvel, velocities);
  return DONE;
}

/* Write the first three rows of a pose (4, 4) from a position (3,) and a rotation (3, 3). */
static void write_pose(double* pose, const double* position, const double* rotation) {
  for (int i = 0; i < 3; i++) {
    memcpy(pose + 4 * i, rotation + 3 * i, 3 * sizeof(double));
    pose[4 * i + 3] = position[i];
  }
}

/* Write the object's distance from the grip point, its touchers and its pose (TrackedObject). */
static void observe_object(const Step* s) {
  const mjData* data = s->data;
  const double* position = data->xpos + 3 * s->object;
  const double* grip = data->site_xpos + 3 * s->grip;
  double x = position[0] - grip[0], y = position[1] - grip[1], z = position[2] - grip[2];
  int64_t touched = 0;
  for (int i = 0; i < data->ncon; i++) {
    const mjContact* contact = data->contact + i;
    int first = contact->geom[0], second = contact->geom[1];
    if (contact->exclude || (first != s->object_geom && second != s->object_geom)) continue;
    int other = first == s->object_geom ? second : first;
    touched |= s->toucher[other < 0 ? s->model->ngeom : other];
  }
  *s->distance = sqrt(x * x + y * y + z * z);
  *s->touched = (double)touched;
  write_pose(s->object_pose, position, data->xmat + 9 * s->object);
}

/* Write reward and success (judged, reach_reward.py). Python's exponential is that of C. */
static void judge(const Step* s) {
  double error = sqrt(*s->error);
  double effort = at_most(*s->tension / s->effort_scale, 1.0);
  *s->reward = exp(-error / s->reward_scale) - s->effort * effort;
  *s->success = error < s->tolerance;
  *s->due = *s->time >= *s->until;
}

/* Of NumPy's static library: what `Generator.standard_normal` calls. */
extern void random_standard_normal_fill(void* generator, ptrdiff_t count, double* samples);

static void sample_noise(const Step* s) {
  int64_t kinds = (s->length_noise != NULL) + (s->tension_noise != NULL);
  if (kinds) random_standard_normal_fill(s->random, kinds * s->muscles, s->noise);
}

/* Write the results of the present state (Report, report.py). */
static void write_report(const Step* s) {
  const mjData* data = s->data;
  int64_t m = s->muscles, n = s->joints;
  const double *k1 = s->polynomial, *k2 = k1 + m, *k3 = k2 + m;
  const double* length_noise = s->noise;
  const double* tension_noise = s->length_noise ? s->noise + m : s->noise;
  double total = 0.0;
  for (int64_t i = 0; i < m; i++) {
    double path = data->ten_length[s->tendon[i]], paid_out, tension;
    if (s->spool[i] < 0) {
      paid_out = path - s->elongation[i];
      tension = (path - data->ctrl[s->actuator[i]]) * s->stiffness[i] + s->bias[i];
      tension = at_most(at_least(tension, s->bias[i]), s->limit[i]);
      tension = at_least(tension + data->ten_velocity[s->tendon[i]] * s->damping[i], 0.0);
    } else {
      double turned = data->qpos[s->spool[i]];
      path = path - turned;
      paid_out = s->drum[i] - turned;
      double x = at_least(path - paid_out - s->elongation[i], 0.0);
      tension = ((k3[i] * x + k2[i]) * x + k1[i]) * x;
    }
    double length = paid_out - s->zero[i];
    total += tension;

    double sensed = length;
    if (s->length_offset) sensed += s->length_offset[i];
    if (s->length_noise) sensed += s->length_noise[i] * length_noise[i];
    if (s->length_quantum) sensed = rint(sensed / s->length_quantum[i]) * s->length_quantum[i];
    s->lengths[i] = at_most(at_least(sensed, s->low[i]), s->high[i]);

    sensed = tension;
    if (s->tension_offset) sensed += s->tension_offset[i];
    if (s->tension_noise) sensed += s->tension_noise[i] * tension_noise[i];
    if (s->tension_offset || s->tension_noise) sensed = at_least(sensed, 0.0);
    s->tensions[i] = at_most(sensed, s->most_tension[i]);

    s->slack_paid_out[i] = at_least(paid_out + s->elongation[i] - path, 0.0);
    double beyond = s->target[i] - length;
    if (s->length_offset) beyond -= s->length_offset[i];
    s->slack_target[i] = at_least(beyond, 0.0);
  }
  double squares = 0.0;
  for (int64_t i = 0; i < n; i++) {
    double angle = s->joint_angles[i] = data->qpos[s->position[i]];
    if (s->goal) squares += (angle - s->goal[i]) * (angle - s->goal[i]);
  }
  *s->error = squares / (double)n;
  *s->tension = total / (double)m;
  *s->time = data->time;
  write_pose(s->hand_pose, data->site_xpos + 3 * s->grip, data->site_xmat + 9 * s->grip);
  if (s->object >= 0) observe_object(s);
  if (s->reward) judge(s);
}

/* Carry out a valid action for one control period, and write the results if that succeeds. */
static int act(Step* s) {
  reason = s->reason;
  mjfLogHandler outer = _mjPRIVATE_setTlsLogHandler(catch_error);
  int outcome = BROKEN;
  if (!setjmp(before)) {
    command(s);
    outcome = advance(s);
  }
  _mjPRIVATE_setTlsLogHandler(outer);
  if (outcome == DONE) {
    sample_noise(s);
    write_report(s);
  }
  return outcome;
}

/* Robots that some threads step. Each thread takes those of its own part first, which are in the
   cache of its core, and then those that no other thread has taken. */
typedef struct {
  Step* steps;           /* (count,) */
  const uint8_t* moving; /* (count,) whether the robot is to be stepped */
  int32_t* outcomes;     /* (count,); DONE for a robot that does not move */
  atomic_uchar* taken;   /* (count,) whether a thread has taken the robot in this step */
  int64_t count;
  int64_t threads; /* largest number of threads */
  void* helpers;   /* the threads beside the caller's, or NULL (threads.c) */
  atomic_int_fast64_t done; /* number of robots of which the step has ended */
} Fleet;

extern void* call_helpers(
    void* helpers, int64_t count, void (*work)(void*, int64_t), void* argument);
extern void end_helpers(void* helpers);

static void work(void* fleet, int64_t thread) {
  Fleet* f = fleet;
  for (int64_t k = 0; k < f->count; k++) {
    int64_t i = (k + thread * f->count / f->threads) % f->count;
    if (atomic_exchange(&f->taken[i], 1)) continue;
    Step* s = &f->steps[i];
    f->outcomes[i] = f->moving[i] ? act(s) : DONE;
    if (s->reward && (!f->moving[i] || f->outcomes[i] != DONE)) {
      *s->reward = 0.0;
      *s->success = *s->due = 0;
    }
    atomic_fetch_add(&f->done, 1);
  }
}

static int are_valid(const Fleet* f) {
  for (int64_t i = 0; i < f->count; i++) {
    if (!is_valid(&f->steps[i])) return 0;
  }
  return 1;
}

/* Step the robots that move; an invalid action moves none. Returns the worst outcome. */
int control_steps(Fleet* f) {
  if (!are_valid(f)) return INVALID;
  atomic_store(&f->done, 0);
  /* From here on helpers take robots, also those that come late. */
  for (int64_t i = 0; i < f->count; i++) atomic_store(&f->taken[i], 0);
  if (f->threads > 1) f->helpers = call_helpers(f->helpers, f->threads - 1, work, f);
  work(f, 0);
  while (atomic_load(&f->done) < f->count) sched_yield(); /* at most for one step of a robot */
  int worst = DONE;
  for (int64_t i = 0; i < f->count; i++) worst = f->outcomes[i] > worst ? f->outcomes[i] : worst;
  return worst;
}

/* End the threads that help. */
void end_fleet(Fleet* f) {
  end_helpers(f->helpers);
  f->helpers = NULL;
}
