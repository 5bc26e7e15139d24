#include "acceptance/mujoco_arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <mujoco/mujoco.h>
#include <stdexcept>

#include <fmt/format.h>

namespace lapservo::internal {
namespace {

constexpr double physics_step_s = 0.001;
constexpr std::array names{"theta", "phi", "rho", "psi"};

// Stiff enough that what friction holds does not creep.
constexpr const char* motor_of = R"(
    <body><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-12 1e-12 1e-12"/>
      <joint name="{0}_motor" type="{1}" axis="0 0 1" armature="{2}" frictionloss="{3}"
             solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"/></body>)";

constexpr const char* links = R"(
    <body><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-12 1e-12 1e-12"/>
      <joint name="theta" type="hinge" axis="0 0 1" armature="{0}"/>
      <body><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-12 1e-12 1e-12"/>
        <joint name="phi" type="hinge" axis="0 1 0" armature="{1}"/>
        <body><inertial pos="0 0 {4}" mass="{5}" diaginertia="1e-4 1e-4 1e-4"/>
          <joint name="rho" type="slide" axis="0 0 1" armature="{2}"/>
          <body><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-12 1e-12 1e-12"/>
            <joint name="psi" type="hinge" axis="0 0 1" armature="{3}"/></body>
        </body>
      </body>
    </body>)";

// A spring and a damper with play in the middle. (MuJoCo's own springs, of this version, have none.)
double transmitted(double motor_ahead, double speed, double play, double stiffness, double damping) {
  const double stretched = motor_ahead - std::clamp(motor_ahead, -play / 2, play / 2);
  return stretched == 0 ? 0 : stiffness * stretched + damping * speed;
}

// The arm in MuJoCo's language (MJCF): links theta, phi, rho, psi in the RCM's frame, a motor beside each.
std::string mjcf_of(const MujocoArmConfig& config) {
  const Eigen::Vector3d& g = config.gravity_in_rcm;
  std::string text = fmt::format(
      "<mujoco model=\"arm\">\n"
      "  <compiler angle=\"radian\"/>\n"
      "  <option timestep=\"{}\" gravity=\"{} {} {}\"/>\n"
      "  <worldbody>",
      physics_step_s, g.x(), g.y(), g.z());
  for (std::size_t i = 0; i < 4; ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    text += fmt::format(fmt::runtime(motor_of), names[i], i == 2 ? "slide" : "hinge", config.motor_inertia[joint],
                        config.friction[joint]);
  }
  const Eigen::Vector4d& inertia = config.link_inertia;
  text += fmt::format(fmt::runtime(links), inertia[0], inertia[1], inertia[2], inertia[3], -config.carriage_behind_m,
                      config.carriage_kg);
  text += "\n  </worldbody>\n  <actuator>\n";
  for (std::size_t i = 0; i < 4; ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    const double kp = config.proportional_gain[joint], kd = config.derivative_gain[joint];
    const double largest = config.largest_force[joint];
    text += fmt::format(
        "    <general joint=\"{}_motor\" gainprm=\"{}\" biastype=\"affine\" biasprm=\"0 {} {}\" "
        "forcelimited=\"true\" forcerange=\"{} {}\"/>\n",
        names[i], kp, -kp, -kd, -largest, largest);
  }
  text += "  </actuator>\n  <equality>\n";
  for (const char* name : names)
    text += fmt::format(
        "    <joint joint1=\"{}\" active=\"false\" solref=\"0.002 1\" solimp=\"0.999 0.9999 0.001\"/>\n", name);
  return text + "  </equality>\n</mujoco>\n";
}

}  // namespace

// Joints of the model are in the order in which they are declared: four motors, then theta, phi, rho, psi.
struct MujocoArm::Physics {
  struct DeleteModel {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
  };
  struct DeleteData {
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  std::unique_ptr<mjModel, DeleteModel> model;
  std::unique_ptr<mjData, DeleteData> data;

  explicit Physics(const std::string& mjcf) {
    const auto files = std::make_unique<mjVFS>();  // large
    mj_defaultVFS(files.get());
    constexpr const char* name = "arm.xml";
    mj_makeEmptyFileVFS(files.get(), name, static_cast<int>(mjcf.size()) + 1);
    std::memcpy(files->filedata[mj_findFileVFS(files.get(), name)], mjcf.c_str(), mjcf.size() + 1);
    std::array<char, 1000> error{};
    model.reset(mj_loadXML(name, files.get(), error.data(), static_cast<int>(error.size())));
    mj_deleteVFS(files.get());
    if (!model) throw std::runtime_error(fmt::format("MuJoCo does not take its model: {}", error.data()));
    data.reset(mj_makeData(model.get()));
  }

  using Joints = Eigen::Map<Eigen::Vector4d>;
  Joints motors() { return Joints(data->qpos); }
  Joints links() { return Joints(data->qpos + 4); }
  Joints motor_speeds() { return Joints(data->qvel); }
  Joints link_speeds() { return Joints(data->qvel + 4); }
  Joints motor_loads() { return Joints(data->qfrc_applied); }
  Joints link_loads() { return Joints(data->qfrc_applied + 4); }
  Joints setpoints() { return Joints(data->ctrl); }
};

MujocoArm::MujocoArm(const MujocoArmConfig& config, const Eigen::Vector4d& q_measured) : config_(config) {
  physics_ = std::make_unique<Physics>(mjcf_of(config));
  Physics& p = *physics_;
  p.motors() = p.links() = q_measured + config.joints.joint_offset;
  mj_forward(p.model.get(), p.data.get());
  const Eigen::Vector4d weight = Physics::Joints(p.data->qfrc_bias + 4);  // what the transmissions must bear
  for (int i = 0; i < 4; ++i) {
    const double side = weight[i] > 0 ? 1 : weight[i] < 0 ? -1 : 0;
    p.links()[i] -= side * config.joints.backlash[i] / 2 + weight[i] / config.stiffness[i];
  }
  setpoint_ = q_measured + weight.cwiseQuotient(config.proportional_gain);
  mj_forward(p.model.get(), p.data.get());
}

MujocoArm::~MujocoArm() = default;

void MujocoArm::servo_jp(const Eigen::Vector4d& setpoint) {
  setpoint_ = setpoint.cwiseMax(config_.joints.lower).cwiseMin(config_.joints.upper);
}

void MujocoArm::step(double dt_s) {
  constexpr double rounding = 1e-9;
  for (ahead_s_ += dt_s; ahead_s_ >= physics_step_s - rounding; ahead_s_ -= physics_step_s) physics_step();
  ahead_s_ = std::max(0.0, ahead_s_);
}

void MujocoArm::physics_step() {
  Physics& p = *physics_;
  p.setpoints() = setpoint_ + config_.joints.joint_offset;
  for (int i = 0; i < 4; ++i) {
    const double force = transmitted(p.motors()[i] - p.links()[i], p.motor_speeds()[i] - p.link_speeds()[i],
                                     config_.joints.backlash[i], config_.stiffness[i], config_.transmission_damping[i]);
    p.link_loads()[i] = force;
    p.motor_loads()[i] = -force;
  }
  mj_step(p.model.get(), p.data.get());
}

Eigen::Vector4d MujocoArm::motors() const {
  return physics_->motors() + ahead_s_ * physics_->motor_speeds() - config_.joints.joint_offset;
}

Eigen::Vector4d MujocoArm::measured_jp() const {
  Eigen::Vector4d measured = motors();
  for (int i = 0; i < 4; ++i) {
    const double resolution = config_.joints.resolution[i];
    if (resolution > 0) measured[i] = std::round(measured[i] / resolution) * resolution;
  }
  return measured;
}

Eigen::Vector4d MujocoArm::true_jp() const {
  return physics_->links() + ahead_s_ * physics_->link_speeds();
}

Eigen::Vector4d MujocoArm::true_velocity() const {
  return physics_->link_speeds();
}

void MujocoArm::block(int joint) {
  Physics& p = *physics_;
  p.model->eq_data[mjNEQDATA * joint] = p.links()[joint] - p.model->qpos0[4 + joint];
  p.model->eq_active[joint] = 1;
}

void MujocoArm::release(int joint) {
  physics_->model->eq_active[joint] = 0;
}

}  // namespace lapservo::internal
