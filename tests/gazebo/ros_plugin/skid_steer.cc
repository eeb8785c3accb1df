// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#include "skid_steer.hh"

#include <std_msgs/Float32.h>

#include "description.hh"

namespace
{
const std::array<const char *, 4> JOINTS = {"leftFrontJoint", "rightFrontJoint", "leftRearJoint", "rightRearJoint"};
const std::array<const char *, 4> NAMES = {"front_left", "front_right", "rear_left", "rear_right"};
}  // namespace

SkidSteer::SkidSteer(gazebo::physics::ModelPtr model, ros::NodeHandle &node)
{
  const auto sdf = PluginOf(model->GetSDF(), "skid_steer_drive");
  separation = Read<double>(sdf, "wheelSeparation");
  radius = Read<double>(sdf, "wheelDiameter") / 2.0;
  period = 1.0 / Read<double>(sdf, "updateRate");
  for (size_t k = 0; k < wheels.size(); ++k)
  {
    const auto name = Read<std::string>(sdf, JOINTS[k]);
    wheels[k] = model->GetJoint(name);
    if (!wheels[k]) throw std::runtime_error("model " + model->GetName() + " has no joint " + name);
    wheels[k]->SetParam("fmax", 0, Read<double>(sdf, "torque"));
    speeds[k] = node.advertise<std_msgs::Float32>(std::string("/gazebo_client/") + NAMES[k] + "_speed", 10);
  }
  const auto topic = Read<std::string>(sdf, "commandTopic");
  commands = node.subscribe(topic, 1, &SkidSteer::OnCommand, this, ros::TransportHints().tcpNoDelay());
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

void SkidSteer::PublishSpeeds()
{
  for (size_t k = 0; k < wheels.size(); ++k)
  {
    std_msgs::Float32 message;
    message.data = static_cast<float>(wheels[k]->GetVelocity(0));
    speeds[k].publish(message);
  }
}
