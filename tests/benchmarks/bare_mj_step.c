/* The least that stepping a model can cost: mj_step in a loop, in C, with nothing around it.
 *
 *   bare_mj_step MODEL.mjb STEPS REPEATS SPEED_MPS [JOINT]
 *
 * Each repeat starts from a fresh state in which JOINT (the first one by default) moves at SPEED_MPS,
 * and runs untimed for 200 steps before STEPS timed ones. Prints the fewest CPU seconds of one
 * thread that a repeat took, then the model's timestep.
 */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <mujoco/mujoco.h>

enum { WARM_UP_STEPS = 200 };

static double cpu_seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
  if (argc < 5) {
    fprintf(stderr, "usage: %s MODEL.mjb STEPS REPEATS SPEED_MPS [JOINT]\n", argv[0]);
    return 2;
  }
  mjModel *model = mj_loadModel(argv[1], NULL);
  if (!model) {
    fprintf(stderr, "%s: no MuJoCo model\n", argv[1]);
    return 2;
  }
  const int steps = atoi(argv[2]);
  const int repeats = atoi(argv[3]);
  const double speed_mps = atof(argv[4]);
  const int joint = argc > 5 ? mj_name2id(model, mjOBJ_JOINT, argv[5]) : 0;
  if (joint < 0 || joint >= model->njnt) {
    fprintf(stderr, "%s: no joint %s\n", argv[1], argv[5]);
    return 2;
  }
  mjData *data = mj_makeData(model);
  double fewest = 1e300;
  for (int repeat = 0; repeat < repeats; repeat++) {
    mj_resetData(model, data);
    data->qvel[model->jnt_dofadr[joint]] = speed_mps;
    for (int i = 0; i < WARM_UP_STEPS; i++) {
      mj_step(model, data);
    }
    const double start = cpu_seconds();
    for (int i = 0; i < steps; i++) {
      mj_step(model, data);
    }
    const double taken = cpu_seconds() - start;
    if (taken < fewest) {
      fewest = taken;
    }
  }
  printf("%.9g %.9g\n", fewest, model->opt.timestep);
  mj_deleteData(data);
  mj_deleteModel(model);
  return 0;
}
