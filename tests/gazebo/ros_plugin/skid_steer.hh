// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>

#include <array>
#include <gazebo/physics/physics.hh>
#include <mutex>

// Skid-steer drive with the parameters and the law of gazebo_ros's plugin, read from the model's own description, and
// the four tachometers. Wheels are in the order front left, front right, rear left, rear right.
class SkidSteer
{
public:
  SkidSteer(gazebo::physics::ModelPtr model, ros::NodeHandle &node);
  // Give the wheels the speeds of the latest command; `seconds` of simulated time, called in every step.
  void Drive(double seconds);
  void PublishSpeeds();
  bool HasCommander() const { return commands.getNumPublishers() > 0; }

private:
  void OnCommand(const geometry_msgs::Twist::ConstPtr &command);

  std::array<gazebo::physics::JointPtr, 4> wheels;
  std::array<ros::Publisher, 4> speeds;
  ros::Subscriber commands;
  std::mutex mutex;
  double forward = 0.0, turn = 0.0;  // [m/s], [rad/s], guarded by the mutex
  double separation = 0.0, radius = 0.0, period = 0.0, last = 0.0;
};
