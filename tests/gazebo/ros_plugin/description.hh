// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// The plugins of gazebo_ros in a model's description: what they would do is read from there.
#pragma once
#include <gazebo/physics/physics.hh>
#include <gazebo/sensors/sensors.hh>
#include <stdexcept>
#include <string>

// The plugin in an element whose library's name has this part.
inline sdf::ElementPtr PluginOf(sdf::ElementPtr parent, const std::string &part)
{
  for (auto each = parent->HasElement("plugin") ? parent->GetElement("plugin") : nullptr; each;
       each = each->GetNextElement("plugin"))
    if (each->Get<std::string>("filename").find(part) != std::string::npos) return each;
  throw std::runtime_error("the description has no plugin " + part);
}

// The element of a sensor in its link's description.
inline sdf::ElementPtr DescriptionOf(const gazebo::sensors::Sensor &sensor, gazebo::physics::LinkPtr link)
{
  for (auto each = link->GetSDF()->GetElement("sensor"); each; each = each->GetNextElement("sensor"))
    if (each->Get<std::string>("name") == sensor.Name()) return each;
  throw std::runtime_error("the description has no sensor " + sensor.Name());
}

template <class Value> Value Read(sdf::ElementPtr element, const std::string &name)
{
  if (!element->HasElement(name)) throw std::runtime_error("a plugin of the description lacks " + name);
  return element->Get<Value>(name);
}
