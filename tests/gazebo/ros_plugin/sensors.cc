// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
#include "sensors.hh"

#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>

#include <cmath>
#include <cstring>
#include <gazebo/common/SphericalCoordinates.hh>

#include "description.hh"

using gazebo::sensors::SensorManager;

namespace
{
struct __attribute__((packed)) Point
{
  float x, y, z, intensity;
  uint16_t ring, column;
};

// The only sensor of a type that a model has; it stops to update itself.
template <class Sensor> std::shared_ptr<Sensor> Find(gazebo::physics::ModelPtr model)
{
  const auto prefix = model->GetScopedName() + "::";
  for (const auto &each : SensorManager::Instance()->GetSensors())
    if (each->ParentName().compare(0, prefix.size(), prefix) == 0)
      if (auto found = std::dynamic_pointer_cast<Sensor>(each))
      {
        found->SetActive(false);
        return found;
      }
  throw std::runtime_error("model " + model->GetName() + " lacks a sensor");
}

ros::Time ToRos(const gazebo::common::Time &time) { return ros::Time(time.sec, time.nsec); }

template <class To, class From> void CopyVector(To &to, const From &from)
{
  to.x = from.X();
  to.y = from.Y();
  to.z = from.Z();
}

sensor_msgs::PointField Field(const std::string &name, uint32_t offset, uint8_t type)
{
  sensor_msgs::PointField field;
  field.name = name;
  field.offset = offset;
  field.datatype = type;
  field.count = 1;
  return field;
}
}  // namespace

Sensors::Sensors(gazebo::physics::ModelPtr model, ros::NodeHandle &node)
{
  const auto linkOf = [&](const gazebo::sensors::Sensor &sensor) {
    return boost::dynamic_pointer_cast<gazebo::physics::Link>(model->GetWorld()->EntityByName(sensor.ParentName()));
  };
  imu = Find<gazebo::sensors::ImuSensor>(model);
  auto plugin = PluginOf(DescriptionOf(*imu, linkOf(*imu)), "gazebo_ros_imu_sensor");
  imuTopic = node.advertise<sensor_msgs::Imu>(Read<std::string>(plugin, "topicName"), 100);
  imuFrame = Read<std::string>(plugin, "frameName");
  if (!Read<bool>(plugin, "initialOrientationAsReference"))
    imu->SetWorldToReferenceOrientation(ignition::math::Quaterniond::Identity);  // as REP-145 demands
  lidar = Find<gazebo::sensors::RaySensor>(model);
  plugin = PluginOf(DescriptionOf(*lidar, linkOf(*lidar)), "laser");
  cloudTopic = node.advertise<sensor_msgs::PointCloud2>(Read<std::string>(plugin, "topicName"), 10);
  cloudFrame = Read<std::string>(plugin, "frameName");
  plugin = PluginOf(model->GetSDF(), "hector_gazebo_ros_gps");
  fixTopic = node.advertise<sensor_msgs::NavSatFix>(Read<std::string>(plugin, "topicName"), 10);
  fixFrame = Read<std::string>(plugin, "frameId");
  antenna = model->GetLink(Read<std::string>(plugin, "bodyName"));
  if (!antenna) throw std::runtime_error("the model lacks the link of the GNSS antenna");
}

// The IMU gets its data from Gazebo's own transport, some steps later: the stamp is that of the data.
void Sensors::PublishImu()
{
  imu->Update(true);
  sensor_msgs::Imu message;
  message.header.stamp = ToRos(imu->LastMeasurementTime());
  message.header.frame_id = imuFrame;
  message.orientation.w = imu->Orientation().W();
  CopyVector(message.orientation, imu->Orientation());
  CopyVector(message.angular_velocity, imu->AngularVelocity());
  CopyVector(message.linear_acceleration, imu->LinearAcceleration());
  if (!message.header.stamp.isZero()) imuTopic.publish(message);
}

void Sensors::PublishFix(const ros::Time &stamp)
{
  const auto here = antenna->GetWorld()->SphericalCoords()->SphericalFromLocal(antenna->WorldPose().Pos());
  sensor_msgs::NavSatFix message;
  message.header.stamp = stamp;
  message.header.frame_id = fixFrame;
  message.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  message.latitude = here.X();
  message.longitude = here.Y();
  message.altitude = here.Z();
  fixTopic.publish(message);
}

void Sensors::PublishCloud(const ros::Time &stamp)
{
  lidar->Update(true);
  const int columns = lidar->RangeCount(), rings = lidar->VerticalRangeCount();
  std::vector<Point> points;
  for (int row = 0; row < rings; ++row)
    for (int column = 0; column < columns; ++column)
    {
      const double range = lidar->Range(row * columns + column);
      if (!(range >= lidar->RangeMin() && range < lidar->RangeMax())) continue;
      const double yaw = lidar->AngleMin().Radian() + column * lidar->AngleResolution();
      const double up = lidar->VerticalAngleMin().Radian() + row * lidar->VerticalAngleResolution();
      const double ahead = range * std::cos(up);
      // Rings from the highest beam down, columns clockwise from ahead, as our clouds count them, so that beams can be
      // compared; the plugin in the description counts rings from below and has no columns.
      const auto clockwise = std::lround(-yaw * columns / (2.0 * M_PI));
      points.push_back({static_cast<float>(ahead * std::cos(yaw)), static_cast<float>(ahead * std::sin(yaw)),
                        static_cast<float>(range * std::sin(up)),
                        static_cast<float>(lidar->Retro(row * columns + column)),
                        static_cast<uint16_t>(rings - 1 - row),
                        static_cast<uint16_t>((clockwise + columns) % columns)});
    }
  sensor_msgs::PointCloud2 message;
  message.header.stamp = stamp;
  message.header.frame_id = cloudFrame;
  message.height = 1;
  message.width = points.size();
  const auto real = sensor_msgs::PointField::FLOAT32, small = sensor_msgs::PointField::UINT16;
  message.fields = {Field("x", 0, real),          Field("y", 4, real),      Field("z", 8, real),
                    Field("intensity", 12, real), Field("ring", 16, small), Field("column", 18, small)};
  message.point_step = sizeof(Point);
  message.row_step = points.size() * sizeof(Point);
  message.is_dense = true;
  message.data.resize(message.row_step);
  std::memcpy(message.data.data(), points.data(), message.row_step);
  cloudTopic.publish(message);
}
