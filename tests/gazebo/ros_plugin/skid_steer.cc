// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#include "skid_steer.hh"

#include <sensor_msgs/JointState.h>

#include <cmath>
#include <sstream>

#include "description.hh"

namespace
{
const std::array<const char *, 4> JOINTS = {"leftFrontJoint", "rightFrontJoint", "leftRearJoint", "rightRearJoint"};

gazebo::physics::JointPtr JointOf(gazebo::physics::ModelPtr model, const std::string &name)
{
  const auto joint = model->GetJoint(name);
  if (!joint) throw std::runtime_error("model " + model->GetName() + " has no joint " + name);
  return joint;
}
}  // namespace

SkidSteer::SkidSteer(gazebo::physics::ModelPtr model, ros::NodeHandle &node)
{
  auto sdf = PluginOf(model->GetSDF(), "skid_steer_drive");
  separation = Read<double>(sdf, "wheelSeparation");
  radius = Read<double>(sdf, "wheelDiameter") / 2.0;
  period = 1.0 / Read<double>(sdf, "updateRate");
  for (size_t k = 0; k < wheels.size(); ++k)
  {
    wheels[k] = JointOf(model, Read<std::string>(sdf, JOINTS[k]));
    wheels[k]->SetParam("fmax", 0, Read<double>(sdf, "torque"));
  }
  const auto topic = Read<std::string>(sdf, "commandTopic");
  commands = node.subscribe(topic, 1, &SkidSteer::OnCommand, this, ros::TransportHints().tcpNoDelay());

  sdf = PluginOf(model->GetSDF(), "joint_state_publisher");
  jointSteps = std::lround(1000.0 / Read<double>(sdf, "updateRate"));
  std::stringstream names(Read<std::string>(sdf, "jointName"));
  for (std::string name; std::getline(names >> std::ws, name, ',');) joints.push_back(JointOf(model, name));
  jointTopic = node.advertise<sensor_msgs::JointState>("/joint_states", 100);
}

void SkidSteer::OnCommand(const geometry_msgs::Twist::ConstPtr &command)
{
  std::lock_guard<std::mutex> lock(mutex);
  forward = command->linear.x;
  turn = command->angular.z;
}

void SkidSteer::Drive(double seconds)
{
  if (seconds - last <= period) return;
  last += period;
  std::lock_guard<std::mutex> lock(mutex);
  for (size_t k = 0; k < wheels.size(); ++k)
  {
    const double side = k % 2 == 0 ? -1.0 : 1.0;
    wheels[k]->SetParam("vel", 0, (forward + side * turn * separation / 2.0) / radius);
  }
}

void SkidSteer::PublishJoints(uint64_t step, const ros::Time &stamp)
{
  if (step % jointSteps != 0) return;
  sensor_msgs::JointState message;
  message.header.stamp = stamp;
  for (const auto &joint : joints)
  {
    message.name.push_back(joint->GetName());
    message.position.push_back(joint->Position(0));
    message.velocity.push_back(joint->GetVelocity(0));
  }
  jointTopic.publish(message);
}
