// Drives the model `twin` of an SDFormat world straight ahead in ign-physics and tells how far it came.
// usage: drive_sdf PLUGIN WORLD.sdf WHEEL_RADIUS_M SPEED_MPS SECONDS
// prints: models in the world, height at rest, metres moved, height at the end
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/Joint.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <iostream>
#include <sdf/Root.hh>
#include <sdf/World.hh>

namespace physics = ignition::physics;
struct Features
    : physics::FeatureList<physics::ForwardStep, physics::GetEngineInfo, physics::GetWorldFromEngine,
                           physics::GetModelFromWorld, physics::GetLinkFromModel,
                           physics::GetJointFromModel, physics::LinkFrameSemantics,
                           physics::SetJointVelocityCommandFeature, physics::sdf::ConstructSdfWorld> {};

int main(int count, char **words) {
  if (count != 6) return 2;
  ignition::plugin::Loader loader;
  physics::EnginePtr<physics::FeaturePolicy3d, Features> engine;
  loader.LoadLib(words[1]);
  using Step = physics::ForwardStep::Implementation<physics::FeaturePolicy3d>;
  for (const auto &name : loader.PluginsImplementing<Step>())
    if ((engine = physics::RequestEngine3d<Features>::From(loader.Instantiate(name)))) break;
  if (!engine) return 3;
  sdf::Root root;
  const auto errors = root.Load(words[2]);
  for (const auto &error : errors) std::cerr << error.Message() << "\n";
  if (!errors.empty()) return 4;
  auto world = engine->ConstructWorld(*root.WorldByIndex(0));
  auto twin = world->GetModel("twin");
  if (!twin) return 5;
  const double radius_m = std::atof(words[3]), speed_mps = std::atof(words[4]);
  physics::ForwardStep::Output output;
  physics::ForwardStep::State state;
  physics::ForwardStep::Input input;
  input.Get<std::chrono::steady_clock::duration>() = std::chrono::milliseconds(1);
  auto place = [&] {
    return twin->GetLink(0)->FrameDataRelativeToWorld().pose.translation().eval();
  };
  for (int i = 0; i < 1000; ++i) world->Step(output, state, input);
  const auto rest = place();
  for (int i = 0; i < 1000 * std::atoi(words[5]); ++i) {
    for (std::size_t j = 0; j < twin->GetJointCount(); ++j) {
      const auto joint = twin->GetJoint(j);
      const auto name = joint->GetName();
      if (name.find("wheel") == std::string::npos && name.find("steer") == std::string::npos) continue;
      const bool steers = name.find("steer") != std::string::npos;
      joint->SetVelocityCommand(0, steers ? 0.0 : speed_mps / radius_m);
    }
    world->Step(output, state, input);
  }
  const auto end = place();
  std::cout << world->GetModelCount() << " " << rest.z() << " " << (end - rest).norm() << " "
            << end.z() << "\n";
}
