// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// gazebo_msgs/ModelStates from its public definition, for systems that have ROS but not the package gazebo_msgs.
#pragma once
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Twist.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <string>
#include <vector>

struct ModelStates
{
  std::vector<std::string> name;
  std::vector<geometry_msgs::Pose> pose;
  std::vector<geometry_msgs::Twist> twist;
};

namespace ros
{
namespace message_traits
{
template <> struct IsMessage<ModelStates> : TrueType {};
template <> struct IsMessage<const ModelStates> : TrueType {};

template <> struct MD5Sum<ModelStates>
{
  static const char *value() { return "48c080191eb15c41858319b4d8a609c2"; }
  static const char *value(const ModelStates &) { return value(); }
};

template <> struct DataType<ModelStates>
{
  static const char *value() { return "gazebo_msgs/ModelStates"; }
  static const char *value(const ModelStates &) { return value(); }
};

template <> struct Definition<ModelStates>
{
  static const char *value()
  {
    return "string[] name\ngeometry_msgs/Pose[] pose\ngeometry_msgs/Twist[] twist\n"
           "================================================================================\n"
           "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
           "================================================================================\n"
           "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
           "================================================================================\n"
           "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
           "================================================================================\n"
           "MSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
           "================================================================================\n"
           "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
  }
  static const char *value(const ModelStates &) { return value(); }
};
}  // namespace message_traits

namespace serialization
{
template <> struct Serializer<ModelStates>
{
  template <typename Stream, typename Message> inline static void allInOne(Stream &stream, Message message)
  {
    stream.next(message.name);
    stream.next(message.pose);
    stream.next(message.twist);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};
}  // namespace serialization
}  // namespace ros
