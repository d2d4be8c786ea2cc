/* A control step of a robot: what `Control` in control.py does, without its overhead.

   Bit for bit the same as there: the same operations in the same order, sums from the first entry
   to the last. Compiled on first use (compiling.py); compiled_control.py fills in the structures.
   Contractions to fused operations must be off.

   Arrays are NumPy's or MuJoCo's, of doubles, but for indices. Lengths are in m, tensions in N. */

#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <mujoco/mujoco.h>

/* Dry friction that follows actuators' forces, in one of the model's arrays (friction.py). */
typedef struct {
  int64_t count;           /* 0: none does */
  double* loss;            /* (count,) of the model */
  const int64_t* actuator; /* (count,) whose force counts */
  const double* ratio;     /* (count,) */
  const double* constant;  /* (count,), or NULL for none */
} Friction;

typedef struct {
  mjModel* model;
  mjData* data;
  int64_t substeps; /* time steps in a control period */
  int64_t muscles;  /* m */
  int64_t joints;   /* n, that wires cross */
  int64_t fingers;  /* their actuator; -1: there are none */
  int64_t grip;     /* the hand's site */

  /* What the hand is to lift (lift.py). */
  int64_t thing; /* its body; -1: there is nothing */
  int64_t thing_geom;
  const int64_t* who; /* (ngeom + 1,) what a geom belongs to; the last for what is none */
  double* thing_pose; /* (4, 4); its last row is not written */

  /* Motors (motors.py): where each one's values lie in MuJoCo's arrays, and its constants, (m,). */
  const int64_t* tendon;
  const int64_t* actuator;
  const int64_t* spool; /* in qpos; -1: the wire does not stretch */
  const double* drum;
  const double* elongation;
  const double* stiffness;
  const double* bias;
  const double* limit;
  const double* damping;
  const double* polynomial; /* (3, m) of the spring's force */
  Friction friction[2];     /* of tendons, and of joints */

  /* Sensors (sensors.py), (m,) or NULL where they read the truth. */
  const double* length_offset;
  const double* length_noise;
  const double* length_quantum;
  const double* tension_offset;
  const double* tension_noise;
  const double* noise; /* standard normal, of lengths, then of tensions, where they have any */

  const double* zero;        /* (m,) paid out in the posture called zero */
  const int64_t* position;   /* (n,) of the joints in qpos */
  double* left_at;           /* (nq + nv,) positions and velocities that the last step ended with */

  /* Spaces (spaces.py), (m,). */
  const double* half;
  const double* middle;
  const double* low;
  const double* high;
  const double* most_tension;

  const double* action; /* (m + 1,), the last for the fingers, if there are some */
  const double* goal;   /* (n,) [rad] joint angles to reach, or NULL */

  double* target; /* (m,) that the action commanded */
  double* told;   /* (4 m + n + 5,): see tell */
  double* pose;   /* (4, 4) of the grip; its last row is not written */

  char reason[256]; /* why it broke */
} Step;

enum { MOST_THREADS = 256 };
enum { DONE, NOT_AN_ACTION, DIVERGED, BROKEN };

/* MuJoCo's errors end the process unless they are caught, as its own bindings do it, too. */
extern mjfLogHandler _mjPRIVATE_setTlsLogHandler(mjfLogHandler handler);
extern mjfLogHandler _mjPRIVATE_getGlobalLogHandler(void);

static _Thread_local jmp_buf before;
static _Thread_local char* reason;

size_t size_of_step(void) { return sizeof(Step); }

static void note(const mjLogMessage* message) {
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

static int is_action(const Step* s) {
  int64_t entries = s->muscles + (s->fingers >= 0);
  for (int64_t i = 0; i < entries; i++) {
    if (!(fabs(s->action[i]) <= 1.0)) return 0;
  }
  return 1;
}

/* Command the motors what the action says (Robot.step, Motors.command). */
static void command(const Step* s) {
  double* ctrl = s->data->ctrl;
  for (int64_t i = 0; i < s->muscles; i++) {
    s->target[i] = s->action[i] * s->half[i] + s->middle[i];
    double paid_out = s->target[i] + s->zero[i];
    if (s->length_offset) paid_out -= s->length_offset[i];
    ctrl[s->actuator[i]] = s->spool[i] < 0 ? paid_out + s->elongation[i] : paid_out;
  }
  if (s->fingers >= 0) ctrl[s->fingers] = s->action[s->muscles];
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

static void write_pose(double* pose, const double* place, const double* turn) {
  for (int i = 0; i < 3; i++) {
    memcpy(pose + 4 * i, turn + 3 * i, 3 * sizeof(double));
    pose[4 * i + 3] = place[i];
  }
}

/* Write the thing's distance from the grip, and by whom it is touched; and its pose (Thing). */
static void look(const Step* s, double* seen) {
  const mjData* data = s->data;
  const double* place = data->xpos + 3 * s->thing;
  const double* grip = data->site_xpos + 3 * s->grip;
  double x = place[0] - grip[0], y = place[1] - grip[1], z = place[2] - grip[2];
  int64_t touched = 0;
  for (int i = 0; i < data->ncon; i++) {
    const mjContact* contact = data->contact + i;
    int first = contact->geom[0], second = contact->geom[1];
    if (contact->exclude || (first != s->thing_geom && second != s->thing_geom)) continue;
    int other = first == s->thing_geom ? second : first;
    touched |= s->who[other < 0 ? s->model->ngeom : other];
  }
  seen[0] = sqrt(x * x + y * y + z * z);
  seen[1] = (double)touched;
  write_pose(s->thing_pose, place, data->xmat + 9 * s->thing);
}

/* Write lengths and tensions that are sensed, within bounds (m,) each; how much more is paid out
   than the path takes, and than the target says (m,) each; joint angles (n,); the mean square
   error of these, the mean tension and the time; and of the thing what is seen (2,). */
void tell(const Step* s) {
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
    s->told[i] = at_most(at_least(sensed, s->low[i]), s->high[i]);

    sensed = tension;
    if (s->tension_offset) sensed += s->tension_offset[i];
    if (s->tension_noise) sensed += s->tension_noise[i] * tension_noise[i];
    if (s->tension_offset || s->tension_noise) sensed = at_least(sensed, 0.0);
    s->told[m + i] = at_most(sensed, s->most_tension[i]);

    s->told[2 * m + i] = at_least(paid_out + s->elongation[i] - path, 0.0);
    double beyond = s->target[i] - length;
    if (s->length_offset) beyond -= s->length_offset[i];
    s->told[3 * m + i] = at_least(beyond, 0.0);
  }
  double* angles = s->told + 4 * m;
  double squares = 0.0;
  for (int64_t i = 0; i < n; i++) {
    angles[i] = data->qpos[s->position[i]];
    if (s->goal) squares += (angles[i] - s->goal[i]) * (angles[i] - s->goal[i]);
  }
  angles[n] = squares / (double)n;
  angles[n + 1] = total / (double)m;
  angles[n + 2] = data->time;
  write_pose(s->pose, data->site_xpos + 3 * s->grip, data->site_xmat + 9 * s->grip);
  if (s->thing >= 0) look(s, angles + n + 3);
}

/* Carry out the action for a control period. */
int act(Step* s) {
  if (!is_action(s)) return NOT_AN_ACTION;
  reason = s->reason;
  mjfLogHandler outer = _mjPRIVATE_setTlsLogHandler(note);
  int state = BROKEN;
  if (!setjmp(before)) {
    command(s);
    state = advance(s);
  }
  _mjPRIVATE_setTlsLogHandler(outer);
  return state;
}

/* Act, then tell what came of it. */
int control_step(Step* s) {
  int state = act(s);
  if (state == DONE) tell(s);
  return state;
}

/* Many robots, each stepped by one of some threads. */
typedef struct {
  Step* steps;           /* (count,) */
  const uint8_t* moving; /* (count,) which of them */
  int32_t* states;       /* (count,) what came of it; DONE where it does not move */
  int64_t count;
  atomic_int_fast64_t next;
} Crowd;

static void* work(void* crowd) {
  Crowd* c = crowd;
  int64_t i;
  while ((i = atomic_fetch_add(&c->next, 1)) < c->count) {
    c->states[i] = c->moving[i] ? control_step(&c->steps[i]) : DONE;
  }
  return NULL;
}

void control_steps(
    Step* steps, const uint8_t* moving, int32_t* states, int64_t count, int64_t threads) {
  Crowd crowd = {steps, moving, states, count, 0};
  pthread_t others[MOST_THREADS];
  int64_t started = 0;
  while (started < MOST_THREADS && started < threads - 1 &&
         !pthread_create(&others[started], NULL, work, &crowd)) {
    started++;
  }
  work(&crowd);
  for (int64_t k = 0; k < started; k++) pthread_join(others[k], NULL);
}
