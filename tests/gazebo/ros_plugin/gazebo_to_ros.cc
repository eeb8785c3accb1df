// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// Publishes to ROS 1 what gazebo_ros would, and drives the robot, where ROS is packaged and gazebo_ros is not: a system
// plugin (gzserver -s), so that worlds and models need no change. It waits for the recorder and the node that steers,
// and pauses the world when the drive is complete.
//
// Environment: MODEL (husky), DRIVE_METRES and DRIVE_SECONDS (the end), CLOUDS (first:last:period [s]; none).
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <gazebo/gazebo.hh>
#include <gazebo/ode/collision.h>
#include <gazebo/physics/ode/ODECollision.hh>
#include <memory>

#include "description.hh"
#include "model_states.hh"
#include "sensors.hh"
#include "skid_steer.hh"

namespace
{
// Physics steps of 1 ms.
constexpr int IMU = 20, MEASURE = 100, FIX = 500;

std::string Setting(const char *name, const char *otherwise)
{
  const char *value = std::getenv(name);
  return value ? value : otherwise;
}

geometry_msgs::Pose ToRos(const ignition::math::Pose3d &pose)
{
  geometry_msgs::Pose result;
  result.position.x = pose.Pos().X();
  result.position.y = pose.Pos().Y();
  result.position.z = pose.Pos().Z();
  result.orientation.w = pose.Rot().W();
  result.orientation.x = pose.Rot().X();
  result.orientation.y = pose.Rot().Y();
  result.orientation.z = pose.Rot().Z();
  return result;
}

geometry_msgs::Twist ToRos(const ignition::math::Vector3d &linear, const ignition::math::Vector3d &angular)
{
  geometry_msgs::Twist result;
  result.linear.x = linear.X();
  result.linear.y = linear.Y();
  result.linear.z = linear.Z();
  result.angular.x = angular.X();
  result.angular.y = angular.Y();
  result.angular.z = angular.Z();
  return result;
}
}  // namespace

class GazeboToRos : public gazebo::SystemPlugin
{
public:
  void Load(int argc, char **argv) override
  {
    ros::init(argc, argv, "gazebo", ros::init_options::NoSigintHandler);  // topic:=other, as for any node
  }

  void Init() override
  {
    node.reset(new ros::NodeHandle);
    node->setParam("/use_sim_time", true);
    spinner.reset(new ros::AsyncSpinner(1));
    spinner->start();
    // A queue of 0 is without limit: on a busy machine the recorder may be late, but must not miss a step.
    clockTopic = node->advertise<rosgraph_msgs::Clock>("/clock", 0);
    statesTopic = node->advertise<ModelStates>("/gazebo/model_states", 0);
    begin = gazebo::event::Events::ConnectWorldUpdateBegin([this](const gazebo::common::UpdateInfo &) { Begin(); });
    end = gazebo::event::Events::ConnectWorldUpdateEnd([this] { End(); });
  }

private:
  void Begin()
  {
    if (!robot) Start();
    drive->Drive(world->SimTime().Double());
  }

  void Start()
  {
    world = gazebo::physics::get_world();
    robot = world->ModelByName(Setting("MODEL", "husky"));
    if (!robot) throw std::runtime_error("the world has no such model");
    const auto pose = PluginOf(robot->GetSDF(), "gazebo_ros_p3d");
    body = robot->GetLink(Read<std::string>(pose, "bodyName"));
    odometrySteps = std::lround(1000.0 / Read<double>(pose, "updateRate"));
    worldFrame = Read<std::string>(pose, "frameName");
    odometryTopic = node->advertise<nav_msgs::Odometry>(Read<std::string>(pose, "topicName"), 0);
    drive.reset(new SkidSteer(robot, *node));
    sensors.reset(new Sensors(robot, *node));
    FindSoft();
    SetSoft(false);
    metres = std::stod(Setting("DRIVE_METRES", "1e9"));
    seconds = std::stod(Setting("DRIVE_SECONDS", "1e9"));
    const auto clouds = Setting("CLOUDS", "");
    if (!clouds.empty() && std::sscanf(clouds.c_str(), "%lf:%lf:%lf", &firstCloud, &lastCloud, &cloudPeriod) != 3)
      throw std::runtime_error("CLOUDS must be first:last:period [s], got " + clouds);
    std::printf("waiting for the recorder and the node that steers\n");
    std::fflush(stdout);
    while (!(odometryTopic.getNumSubscribers() > 0 && statesTopic.getNumSubscribers() > 0 && drive->HasCommander()))
    {
      PublishClock();  // with /use_sim_time the recorder subscribes to nothing before it knows the time
      gazebo::common::Time::MSleep(20);
    }
    before = robot->WorldPose().Pos();
    std::printf("drive begins\n");
    std::fflush(stdout);
  }

  void End()
  {
    if (!robot || done) return;
    const auto time = world->SimTime();
    const ros::Time stamp(time.sec, time.nsec);
    const auto step = world->Iterations();
    PublishClock();
    PublishStates();
    if (step % odometrySteps == 0) PublishOdometry(stamp);
    if (step % IMU == 0) sensors->PublishImu();
    if (step % FIX == 0) sensors->PublishFix(stamp);
    drive->PublishJoints(step, stamp);
    if (CloudIsDue(step))
    {
      SetSoft(true);
      sensors->PublishCloud(stamp);
      SetSoft(false);
    }
    if (step % MEASURE == 0) Measure(stamp.toSec());
  }

  void PublishClock()
  {
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(world->SimTime().sec, world->SimTime().nsec);
    clockTopic.publish(clock);
  }

  // Grass, leaves and distant land, which only rays can hit, by the thousand: the physics asks each of them in every
  // step. Between two clouds they are out of its way.
  void FindSoft()
  {
    for (const auto &model : world->Models())
      for (const auto &link : model->GetLinks())
        for (const auto &each : link->GetCollisions())
          if (const auto found = boost::dynamic_pointer_cast<gazebo::physics::ODECollision>(each))
            if (each->GetSurface()->collideBitmask == 0 && found->GetCollisionId()) soft.push_back(found);
  }

  void SetSoft(bool present)
  {
    for (const auto &each : soft) present ? dGeomEnable(each->GetCollisionId()) : dGeomDisable(each->GetCollisionId());
  }

  bool CloudIsDue(uint64_t step) const
  {
    const auto period = std::lround(cloudPeriod * 1000.0);
    return period > 0 && step % period == 0 && step >= firstCloud * 1000.0 - 0.5 && step <= lastCloud * 1000.0 + 0.5;
  }

  void PublishStates()
  {
    ModelStates message;
    for (const auto &model : world->Models())
    {
      message.name.push_back(model->GetName());
      message.pose.push_back(ToRos(model->WorldPose()));
      message.twist.push_back(ToRos(model->WorldLinearVel(), model->WorldAngularVel()));
    }
    statesTopic.publish(message);
  }

  void PublishOdometry(const ros::Time &stamp)
  {
    nav_msgs::Odometry message;
    message.header.stamp = stamp;
    message.header.frame_id = worldFrame;
    message.child_frame_id = body->GetName();
    message.pose.pose = ToRos(body->WorldPose());
    message.twist.twist = ToRos(body->WorldLinearVel(), body->WorldAngularVel());
    odometryTopic.publish(message);
  }

  // Add to the path at 10 Hz, and end the drive.
  void Measure(double time)
  {
    const auto here = robot->WorldPose().Pos();
    path += (here - before).Length();
    before = here;
    done = path >= metres || time >= seconds;
    if (!done) return;
    std::printf("drive ends: %.3f s, path %.3f m\n", time, path);
    std::fflush(stdout);
    world->SetPaused(true);
  }

  gazebo::event::ConnectionPtr begin, end;
  gazebo::physics::WorldPtr world;
  gazebo::physics::ModelPtr robot;
  gazebo::physics::LinkPtr body;
  std::string worldFrame;
  uint64_t odometrySteps = 1;
  std::unique_ptr<ros::NodeHandle> node;
  std::unique_ptr<ros::AsyncSpinner> spinner;
  std::unique_ptr<SkidSteer> drive;
  std::unique_ptr<Sensors> sensors;
  std::vector<gazebo::physics::ODECollisionPtr> soft;
  ros::Publisher clockTopic, statesTopic, odometryTopic;
  ignition::math::Vector3d before;
  double path = 0.0, metres = 0.0, seconds = 0.0, firstCloud = 0.0, lastCloud = 0.0, cloudPeriod = 0.0;
  bool done = false;
};

GZ_REGISTER_SYSTEM_PLUGIN(GazeboToRos)
