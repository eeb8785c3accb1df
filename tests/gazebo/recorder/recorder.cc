// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// System plugin of Gazebo 11: appends every reading of every sensor, and the poses of models that can move, to files in
// the folder RECORD_FOLDER, in double precision, without the transport's queues.
//
// Ray and GNSS sensors are updated from here, at the exact multiples of their period: Gazebo's own thread makes a scan when
// it finds the time, while the world moves on.
//
// A file is named model__link__sensor.KIND. A record is: stamp [ns of simulated time, int64], rows and columns [int32], data.
//   ray    float64 (rows, columns) ranges [m], infinite without a hit; then float64 (rows, columns) laser_retro
//   image  uint8 (rows, columns, 3) RGB
//   imu    float64 (10): orientation w x y z, angular velocity [rad/s], linear acceleration [m/s^2]
//   gps    float64 (3): latitude, longitude [deg], altitude [m]
//   pose   float64 (13): position [m], orientation w x y z, linear [m/s] and angular velocity [rad/s], all in the world frame
//
// A file tour.txt in the folder (name of a model; then lines x y z roll pitch yaw) has the model moved to each pose in turn;
// a record of tour.stops is the pose (x y z, w x y z) at the stamp from which the model is there.
//
// Gazebo ends when each sensor has RECORD_COUNT readings (0: without limit), at each stop of the tour if there is one, when
// RECORD_SECONDS of simulated time have passed, or when a file "stop" appears. summary.txt then holds seconds of simulated and of wall time since
// the first step, and the largest resident memory [MB].
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gazebo/common/common.hh>
#include <gazebo/gazebo.hh>
#include <gazebo/physics/physics.hh>
#include <gazebo/sensors/sensors.hh>

namespace gazebo {

using Clock = std::chrono::steady_clock;

static double Setting(const char *name) {
  const char *text = std::getenv(name);
  return text ? std::atof(text) : 0.0;
}

/// One file. Each is written by one thread only, but its count is read by another.
struct Stream {
  std::ofstream file;
  std::atomic<int> count{0};

  void Append(const common::Time &stamp, int32_t rows, int32_t columns, const void *data, size_t bytes) {
    const int64_t ns = int64_t(stamp.sec) * 1000000000 + stamp.nsec;
    file.write(reinterpret_cast<const char *>(&ns), 8);
    file.write(reinterpret_cast<const char *>(&rows), 4);
    file.write(reinterpret_cast<const char *>(&columns), 4);
    file.write(static_cast<const char *>(data), bytes);
    file.flush();
    ++count;
  }
  void Append(const common::Time &stamp, const std::vector<double> &row) {
    Append(stamp, 1, int32_t(row.size()), row.data(), row.size() * 8);
  }
};

/// A sensor that is updated from here.
struct Driven {
  sensors::SensorPtr sensor;
  common::Time period, due;
};

class Recorder : public SystemPlugin {
 public:
  void Load(int, char **) override {
    folder = std::getenv("RECORD_FOLDER");
    limitCount = int(Setting("RECORD_COUNT"));
    limitSeconds = Setting("RECORD_SECONDS");
    std::ifstream file(folder + "/tour.txt");
    ignition::math::Pose3d pose;
    for (file >> toured; file >> pose;) tour.push_back(pose);
    if (!tour.empty()) stops = Open("tour", "stops");
  }
  void Init() override {
    update = event::Events::ConnectWorldUpdateEnd([this] { Update(); });
  }

 private:
  std::string folder;
  int limitCount = 0;
  double limitSeconds = 0;
  event::ConnectionPtr update;
  std::vector<event::ConnectionPtr> connections;
  std::map<std::string, std::shared_ptr<Stream>> readings, poses;
  std::vector<Driven> driven;
  std::string toured;
  std::vector<ignition::math::Pose3d> tour;
  size_t stop = 0;
  std::shared_ptr<Stream> stops;
  Clock::time_point start;
  common::Time simStart;
  bool started = false, ending = false;

  std::shared_ptr<Stream> Open(std::string name, const std::string &kind) {
    for (size_t at; (at = name.find("::")) != std::string::npos;) name.replace(at, 2, "__");
    auto stream = std::make_shared<Stream>();
    stream->file.open(folder + "/" + name + "." + kind, std::ios::binary);
    return stream;
  }

  void Update() {
    auto world = physics::get_world();
    if (!started) {
      started = true;
      start = Clock::now();
      simStart = world->SimTime();
      std::ofstream(folder + "/started");
      if (!tour.empty()) Move(*world);
    }
    Connect(world->Name());
    for (auto &one : driven)
      if (world->SimTime() >= one.due) {
        one.sensor->Update(true);
        one.due += one.period;
      }
    for (auto &model : world->Models())
      if (!model->IsStatic()) RecordPose(world->SimTime(), *model);
    if (ending) return;
    bool complete = limitCount > 0 && !readings.empty();
    for (auto &reading : readings) complete = complete && reading.second->count >= limitCount;
    if (complete && stop + 1 < tour.size()) {
      ++stop;
      Move(*world);
      complete = false;
    }
    struct stat unused;
    const bool asked = world->Iterations() % 50 == 0 && ::stat((folder + "/stop").c_str(), &unused) == 0;
    const double simulated = (world->SimTime() - simStart).Double();
    if (complete || asked || (limitSeconds > 0 && simulated >= limitSeconds)) End(simulated);
  }

  /// Moves the model of the tour to its next pose; the readings that it shall make there are counted from here.
  void Move(physics::World &world) {
    auto model = world.ModelByName(toured);
    if (!model) {
      gzerr << "tour.txt names a model that is not in the world: " << toured << "\n";
      return End(0.0);
    }
    const auto &pose = tour[stop];
    model->SetWorldPose(pose);
    stops->Append(world.SimTime(), {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), pose.Rot().W(), pose.Rot().X(),
                                    pose.Rot().Y(), pose.Rot().Z()});
    for (auto &reading : readings) reading.second->count = 0;
  }

  void End(double simulated) {
    ending = true;
    const double wall = std::chrono::duration<double>(Clock::now() - start).count();
    rusage used;
    getrusage(RUSAGE_SELF, &used);
    std::ofstream(folder + "/summary.txt") << simulated << " " << wall << " " << used.ru_maxrss / 1024 << "\n";
    kill(getpid(), SIGINT);  // gzserver then ends as with Ctrl-C
  }

  void RecordPose(const common::Time &stamp, physics::Model &model) {
    auto &stream = poses[model.GetName()];
    if (!stream) stream = Open(model.GetName(), "pose");
    const auto pose = model.WorldPose();
    const auto v = model.WorldLinearVel(), w = model.WorldAngularVel();
    stream->Append(stamp, {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), pose.Rot().W(), pose.Rot().X(), pose.Rot().Y(),
                           pose.Rot().Z(), v.X(), v.Y(), v.Z(), w.X(), w.Y(), w.Z()});
  }

  /// Connects to sensors that are new.
  void Connect(const std::string &world) {
    for (auto &sensor : sensors::SensorManager::Instance()->GetSensors()) {
      const std::string name = sensor->ScopedName().substr(world.size() + 2);
      if (readings.count(name)) continue;
      std::function<void(Stream &)> record;
      std::string kind;
      if (auto ray = std::dynamic_pointer_cast<sensors::RaySensor>(sensor)) {
        kind = "ray";
        record = [r = ray.get()](Stream &out) { RecordRay(*r, out); };
      } else if (auto camera = std::dynamic_pointer_cast<sensors::CameraSensor>(sensor)) {
        kind = "image";
        record = [c = camera.get()](Stream &out) {
          const int32_t rows = c->ImageHeight(), columns = c->ImageWidth();
          if (c->ImageData()) out.Append(c->LastMeasurementTime(), rows, columns, c->ImageData(), size_t(rows) * columns * 3);
        };
      } else if (auto imu = std::dynamic_pointer_cast<sensors::ImuSensor>(sensor)) {
        kind = "imu";
        record = [i = imu.get()](Stream &out) {
          const auto q = i->Orientation();
          const auto w = i->AngularVelocity(), a = i->LinearAcceleration();
          // Gazebo turns gravity by the pose of now, so the reading belongs to now, whatever the stamp of its velocities.
          out.Append(physics::get_world()->SimTime(), {q.W(), q.X(), q.Y(), q.Z(), w.X(), w.Y(), w.Z(), a.X(), a.Y(), a.Z()});
        };
      } else if (auto gps = std::dynamic_pointer_cast<sensors::GpsSensor>(sensor)) {
        kind = "gps";
        record = [g = gps.get()](Stream &out) {
          out.Append(g->LastMeasurementTime(), {g->Latitude().Degree(), g->Longitude().Degree(), g->Altitude()});
        };
      } else {
        continue;
      }
      auto stream = readings[name] = Open(name, kind);
      const bool own = (kind == "ray" || kind == "gps") && sensor->UpdateRate() > 0;
      sensor->SetActive(!own);  // without a subscriber most sensors sleep
      const common::Time period(own ? 1.0 / sensor->UpdateRate() : 0.0);
      if (own) driven.push_back({sensor, period, physics::get_world()->SimTime() + period});  // Gazebo makes the first
      connections.push_back(sensor->ConnectUpdated([stream, record] { record(*stream); }));
    }
  }

  static void RecordRay(sensors::RaySensor &sensor, Stream &out) {
    std::vector<double> values;
    sensor.Ranges(values);
    const size_t count = values.size();
    for (size_t k = 0; k < count; ++k) values.push_back(sensor.Retro(k));
    const int32_t rows = sensor.VerticalRangeCount();
    out.Append(sensor.LastMeasurementTime(), rows, int32_t(count) / rows, values.data(), values.size() * 8);
  }
};

GZ_REGISTER_SYSTEM_PLUGIN(Recorder)
}  // namespace gazebo
