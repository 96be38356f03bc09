// Moves cars in Gazebo's own physics (ign-physics) in answer to what comes down the pipe.
// usage: gazebo_runner PLUGIN.so WHEEL_RADIUS_M WHEELBASE_M TRACK_M MASS_KG DRAG_NPV2 ROLLING_N STEP_S
// Each car has a world of its own: level ground and the model `twin` of the SDFormat that begins it.
// stdin, all numbers doubles: `1 row x y yaw vx vy yaw_rate tire_rad length`, then the SDFormat;
// `2 cars steps`, then drive, brake and climb (cars) and tyre angles (steps, cars).
// stdout: 0 for a car that began; x y yaw vx vy yaw_rate tire_rad (7, cars) after a tick.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/FreeGroup.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/Joint.hh>
#include <ignition/physics/RemoveEntities.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <iostream>
#include <sdf/Root.hh>
#include <sdf/World.hh>
#include <string>
#include <vector>

namespace physics = ignition::physics;
struct Features
    : physics::FeatureList<
          physics::ForwardStep, physics::GetEngineInfo, physics::GetWorldFromEngine,
          physics::GetModelFromWorld, physics::GetLinkFromModel, physics::GetJointFromModel,
          physics::LinkFrameSemantics, physics::FindFreeGroupFeature,
          physics::SetFreeGroupWorldVelocity, physics::GetBasicJointState,
          physics::SetBasicJointState, physics::SetJointVelocityCommandFeature,
          physics::sdf::ConstructSdfWorld> {};
using Policy = physics::FeaturePolicy3d;
using JointPtr = physics::Joint3dPtr<Features>;

constexpr double kStep = 0.002, kFrontShare = 0.66, kHeldBelow = 0.05;

struct Car {
  physics::World3dPtr<Features> world;
  physics::Link3dPtr<Features> body;
  std::vector<JointPtr> wheels, steers;  // wheels: rear left, rear right, front left, front right
  double angle = 0.0;
};

static double radius, wheelbase, track, mass, drag, rolling, step_s;
static bool read(double *into, std::size_t count) {
  return std::fread(into, sizeof(double), count, stdin) == count;
}
static double angle_of(double tire, double side) {  // Ackermann: side is +1 on the left
  const double bend = std::tan(tire) / wheelbase;
  return std::atan(wheelbase * bend / (1.0 - side * track / 2.0 * bend));
}

template <class Engine> static bool begin(Engine &engine, std::vector<Car> &cars) {
  double given[9];
  if (!read(given, 9)) return false;
  const auto row = static_cast<std::size_t>(given[0]);
  std::string text(static_cast<std::size_t>(given[8]), ' ');
  if (std::fread(text.data(), 1, text.size(), stdin) != text.size()) return false;
  sdf::Root root;
  if (const auto errors = root.LoadSdfString(text); !errors.empty()) {
    std::cerr << errors[0].Message() << "\n";
    return false;
  }
  if (cars.size() <= row) cars.resize(row + 1);
  Car &car = cars[row] = Car{};
  car.world = engine->ConstructWorld(*root.WorldByIndex(0));
  auto twin = car.world->GetModel("twin");
  if (!twin) return false;
  car.body = twin->GetLink("base_link");
  for (const char *name : {"rear_left", "rear_right", "front_left", "front_right"})
    car.wheels.push_back(twin->GetJoint(std::string(name) + "_wheel_joint"));
  for (const char *name : {"front_left_steer_joint", "front_right_steer_joint"})
    car.steers.push_back(twin->GetJoint(name));
  const double yaw = given[3], u = given[4], v = given[5], rate = given[6];
  car.angle = given[7];
  for (int side = 0; side < 2; ++side)
    car.steers[side]->SetPosition(0, angle_of(car.angle, side == 0 ? 1.0 : -1.0));
  auto group = twin->FindFreeGroup();
  group->SetWorldLinearVelocity(Eigen::Vector3d(u * std::cos(yaw) - v * std::sin(yaw),
                                                u * std::sin(yaw) + v * std::cos(yaw), 0.0));
  group->SetWorldAngularVelocity(Eigen::Vector3d(0.0, 0.0, rate));
  for (int wheel = 0; wheel < 4; ++wheel) {
    const double y = (wheel % 2 == 0 ? 0.5 : -0.5) * track, x = wheel < 2 ? 0.0 : wheelbase;
    const double angle = wheel < 2 ? 0.0 : angle_of(car.angle, wheel % 2 == 0 ? 1.0 : -1.0);
    const double along = (u - rate * y) * std::cos(angle) + (v + rate * x) * std::sin(angle);
    car.wheels[wheel]->SetVelocity(0, along / radius);
  }
  return true;
}

static void advance(Car &car, double drive, double brake, double climb, double target, int parts) {
  physics::ForwardStep::Output output;
  physics::ForwardStep::State state;
  physics::ForwardStep::Input input;
  input.Get<std::chrono::steady_clock::duration>() =
      std::chrono::duration_cast<std::chrono::steady_clock::duration>(
          std::chrono::duration<double>(kStep));
  const double from = car.angle;
  for (int part = 1; part <= parts; ++part) {
    car.angle = from + (target - from) * part / parts;
    for (int side = 0; side < 2; ++side) {
      auto &joint = car.steers[side];
      const double wanted = angle_of(car.angle, side == 0 ? 1.0 : -1.0);
      joint->SetVelocityCommand(0, (wanted - joint->GetPosition(0)) / kStep);
    }
    const auto motion = car.body->FrameDataRelativeToWorld();
    const double u = (motion.pose.linear().transpose() * motion.linearVelocity).x();
    const double push = mass * (drive - climb) - drag * u * std::abs(u);
    for (int wheel = 0; wheel < 4; ++wheel) {
      const double share = 0.5 * (wheel < 2 ? 1.0 - kFrontShare : kFrontShare);
      const double spin = car.wheels[wheel]->GetVelocity(0) * radius;
      // A brake that holds: as strong as asked for, and a damper towards standstill.
      const double against = std::clamp(spin / kHeldBelow, -1.0, 1.0);
      double force = -share * (mass * brake + rolling) * against;
      if (wheel < 2) force += 0.5 * push;
      car.wheels[wheel]->SetForce(0, force * radius);
    }
    car.world->Step(output, state, input);
  }
}

template <class Engine> static int serve(Engine &engine) {
  std::vector<Car> cars;
  double kind = 0.0;
  const int parts = std::max(1, static_cast<int>(std::lround(step_s / kStep)));
  while (read(&kind, 1)) {
    if (kind == 1.0) {
      if (!begin(engine, cars)) return 5;
      const double done = 0.0;
      std::fwrite(&done, sizeof done, 1, stdout);
    } else {
      double size[2];
      if (!read(size, 2)) return 6;
      const auto count = static_cast<std::size_t>(size[0]), steps = static_cast<std::size_t>(size[1]);
      std::vector<double> given((3 + steps) * count), found(7 * count);
      if (count > cars.size() || !read(given.data(), given.size())) return 6;
      for (std::size_t one = 0; one < count; ++one) {
        Car &car = cars[one];
        for (std::size_t step = 0; step < steps; ++step)
          advance(car, given[one], given[count + one], given[2 * count + one],
                  given[(3 + step) * count + one], parts);
        const auto motion = car.body->FrameDataRelativeToWorld();
        const Eigen::Matrix3d axes = motion.pose.linear();
        const Eigen::Vector3d within = axes.transpose() * motion.linearVelocity;
        const double row[] = {motion.pose.translation().x(), motion.pose.translation().y(),
                              std::atan2(axes(1, 0), axes(0, 0)), within.x(), within.y(),
                              motion.angularVelocity.z(), car.angle};
        for (int column = 0; column < 7; ++column) found[column * count + one] = row[column];
      }
      std::fwrite(found.data(), sizeof(double), found.size(), stdout);
    }
    std::fflush(stdout);
  }
  return 0;
}

int main(int count, char **words) {
  if (count != 9) return 2;
  double *const numbers[] = {&radius, &wheelbase, &track, &mass, &drag, &rolling, &step_s};
  for (int one = 0; one < 7; ++one) *numbers[one] = std::atof(words[2 + one]);
  ignition::plugin::Loader loader;
  physics::EnginePtr<Policy, Features> engine;
  loader.LoadLib(words[1]);
  using Step = physics::ForwardStep::Implementation<Policy>;
  for (const auto &name : loader.PluginsImplementing<Step>())
    if ((engine = physics::RequestEngine3d<Features>::From(loader.Instantiate(name)))) break;
  if (!engine) return 3;
  return serve(engine);
}
