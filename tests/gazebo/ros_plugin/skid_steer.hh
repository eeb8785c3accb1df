// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>

#include <array>
#include <gazebo/physics/physics.hh>
#include <mutex>
#include <vector>

// Skid-steer drive with the parameters and the law of gazebo_ros's plugin, and its joint states, both read from the
// model's description. Wheels are in the order front left, front right, rear left, rear right.
class SkidSteer
{
public:
  SkidSteer(gazebo::physics::ModelPtr model, ros::NodeHandle &node);
  // Give the wheels the speeds of the latest command; `seconds` of simulated time, called in every step.
  void Drive(double seconds);
  // Publish the joint states if they are due after `step` steps of 1 ms.
  void PublishJoints(uint64_t step, const ros::Time &stamp);
  bool HasCommander() const { return commands.getNumPublishers() > 0; }

private:
  void OnCommand(const geometry_msgs::Twist::ConstPtr &command);

  std::array<gazebo::physics::JointPtr, 4> wheels;
  std::vector<gazebo::physics::JointPtr> joints;
  ros::Publisher jointTopic;
  uint64_t jointSteps = 1;
  ros::Subscriber commands;
  std::mutex mutex;
  double forward = 0.0, turn = 0.0;  // [m/s], [rad/s], guarded by the mutex
  double separation = 0.0, radius = 0.0, period = 0.0, last = 0.0;
};
