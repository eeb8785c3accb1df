// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <ros/ros.h>

#include <gazebo/physics/physics.hh>
#include <gazebo/sensors/sensors.hh>

// The sensors of a model as topics. Each is read when the caller asks for it, in the thread of the physics, so that a
// reading and its stamp belong to one step; left to themselves sensors of Gazebo run beside the physics.
class Sensors
{
public:
  Sensors(gazebo::physics::ModelPtr model, ros::NodeHandle &node);
  void PublishImu();
  void PublishFix(const ros::Time &stamp);
  void PublishCloud(const ros::Time &stamp);

private:
  ros::Publisher imuTopic, fixTopic, cloudTopic;
  std::string imuFrame, fixFrame, cloudFrame;
  gazebo::sensors::ImuSensorPtr imu;
  gazebo::sensors::RaySensorPtr lidar;
  gazebo::physics::LinkPtr antenna;
};
