// A skill as a ros2_control controller: `structlearn export pour --cpp include` writes the header.
//
// An example, which was compiled against stubs only: name the interfaces as your hardware does, and
// have it check limits. It starts where the robot is, and commands a pose in every period. A sensor
// that stops must read NaN, as drivers do, since its interfaces tell nothing about age.
#include <controller_interface/controller_interface.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/rclcpp.hpp>

#include <optional>

#include "skill_pour.hpp"

namespace skill = skill_pour;
using controller_interface::CallbackReturn, controller_interface::interface_configuration_type;
using controller_interface::return_type, controller_interface::InterfaceConfiguration;

const std::vector<std::string> kPose = {"tcp/position.x", "tcp/position.y", "tcp/position.z",
                                        "tcp/orientation.w", "tcp/orientation.x",
                                        "tcp/orientation.y", "tcp/orientation.z"};
const std::string kSensor = "sensor/channel.";  // then the number of the channel

class SkillController : public controller_interface::ControllerInterface {
 public:
  CallbackReturn on_init() override { return CallbackReturn::SUCCESS; }

  InterfaceConfiguration command_interface_configuration() const override {
    return {interface_configuration_type::INDIVIDUAL, kPose};
  }

  InterfaceConfiguration state_interface_configuration() const override {
    std::vector<std::string> names = kPose;
    for (std::size_t i = 0; i < skill::kChannels; ++i) names.push_back(kSensor + std::to_string(i));
    return {interface_configuration_type::INDIVIDUAL, names};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State&) override {  // may allocate and throw
    const auto at = [this](std::size_t i) { return state_interfaces_[i].get_value(); };
    try {
      controller_.emplace(static_cast<double>(get_update_rate()));
      controller_->start({at(0), at(1), at(2)}, {at(3), at(4), at(5), at(6)});
    } catch (const std::invalid_argument& error) {
      RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
      return CallbackReturn::ERROR;
    }
    return CallbackReturn::SUCCESS;
  }

  return_type update(const rclcpp::Time&, const rclcpp::Duration&) override {
    skill::Sample sample{};
    for (std::size_t i = 0; i < sample.size(); ++i) sample[i] = state_interfaces_[7 + i].get_value();
    controller_->tick(&sample);  // its flags say whether the sensor is stale or feedback saturated
    for (std::size_t i = 0; i < 3; ++i) command(i, controller_->position()[i]);
    for (std::size_t i = 0; i < 4; ++i) command(3 + i, controller_->orientation()[i]);
    return return_type::OK;  // after its end, the skill stays at its goal
  }

 private:
  void command(std::size_t i, double value) {
    static_cast<void>(command_interfaces_[i].set_value(value));  // returns bool from Jazzy on
  }

  std::optional<skill::Controller> controller_;
};

PLUGINLIB_EXPORT_CLASS(SkillController, controller_interface::ControllerInterface)
