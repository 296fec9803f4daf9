// What examples/ros2_control_skill.cpp uses of ROS 2, declared as there; it does nothing.
#ifndef ROS2_CONTROL_STUBS
#define ROS2_CONTROL_STUBS

#include <cstdio>
#include <string>
#include <vector>

namespace rclcpp {
struct Time {};
struct Duration {};
struct Logger {};
}  // namespace rclcpp

namespace rclcpp_lifecycle {
struct State {};
struct LifecycleNode {
  rclcpp::Logger get_logger() const { return {}; }
};
}  // namespace rclcpp_lifecycle

namespace controller_interface {
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names;
};

struct LoanedInterface {
  [[nodiscard]] bool set_value(double) { return true; }
  double get_value() const { return 0.0; }
};

class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) = 0;
  virtual return_type update(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  unsigned get_update_rate() const { return 1000; }
  rclcpp_lifecycle::LifecycleNode* get_node() { return &node_; }

 protected:
  std::vector<LoanedInterface> command_interfaces_, state_interfaces_;

 private:
  rclcpp_lifecycle::LifecycleNode node_;
};
}  // namespace controller_interface

#define RCLCPP_ERROR(logger, ...) (static_cast<void>(logger), std::printf(__VA_ARGS__))
#define PLUGINLIB_EXPORT_CLASS(type, base) \
  base* exported() { return new type; }

#endif
