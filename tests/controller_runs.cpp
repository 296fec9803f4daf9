// Runs controllers of exported skills: reads commands from stdin, writes what they put out to stdout.
// Everything is doubles. A command is its number and arguments; see `test_cpp_export.py`.
#include <cstdio>
#include <cstdlib>
#include <new>
#include <optional>
#include <string>

#include "skill_felt.hpp"
#include "skill_plain.hpp"
#include "skill_strange.hpp"

static long allocations = 0;

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

enum Command { PLAN, START, TICK, TICK_WITH_SAMPLE, MOVE_GOAL, COPY };

template <std::size_t N>
bool read(std::array<double, N>& values) {
  return std::fread(values.data(), sizeof(double), N, stdin) == N;
}

template <std::size_t N>
std::array<double, N> read() {
  std::array<double, N> values{};
  if (!read(values)) std::exit(2);
  return values;
}

template <std::size_t N>
void write(const std::array<double, N>& values) {
  if (N > 0) std::fwrite(values.data(), sizeof(double), N, stdout);
}

template <class Controller, class Durations, class Goals>
void run() {
  using Sample = std::decay_t<decltype(std::declval<Controller>().deviation())>;
  using Coupling = std::decay_t<decltype(std::declval<Controller>().coupling())>;
  constexpr std::size_t kChannels = std::tuple_size_v<Sample>, kAxes = std::tuple_size_v<Coupling>;
  std::optional<Controller> controller;
  std::array<double, 1> command{};
  while (read(command)) {
    double result = 0.0;
    long before = allocations;
    try {
      switch (static_cast<int>(command[0])) {
        case PLAN: {
          const auto [rate_hz, feedback] = read<2>();
          const Durations durations = read<std::tuple_size_v<Durations>>();
          Goals goals{};
          for (auto& goal : goals) goal = {read<3>(), read<4>()};
          controller.emplace(rate_hz, durations, goals, feedback != 0.0);
          before = allocations;
          break;
        }
        case START: {
          const auto position = read<3>();
          controller->start(position, read<4>());
          break;
        }
        case TICK:
          result = controller->tick();
          break;
        case TICK_WITH_SAMPLE: {
          const Sample sample = read<kChannels>();
          result = controller->tick(&sample);
          break;
        }
        case MOVE_GOAL: {
          const auto [primitive, turned] = read<2>();
          const auto position = read<3>();
          const auto orientation = read<4>();
          controller->move_goal(static_cast<std::size_t>(primitive), position,
                                turned != 0.0 ? &orientation : nullptr);
          break;
        }
        case COPY:  // it continues on its own
          controller.emplace(Controller(*controller));
          before = allocations;
          break;
        default:
          std::exit(3);
      }
    } catch (const std::invalid_argument& error) {
      std::fprintf(stderr, "%s\n", error.what());
      result = -1.0;
      before = allocations;
    }
    if (allocations != before) std::exit(4);
    write<1>({result});
    if (command[0] == PLAN) {
      for (std::size_t i = 0; i < 23 + kChannels + kAxes; ++i) write<1>({std::nan("")});
      continue;
    }
    write(controller->position());
    write(controller->velocity());
    write(controller->acceleration());
    write(controller->orientation());
    write(controller->angular_velocity());
    write(controller->angular_acceleration());
    write(controller->deviation());
    write(controller->coupling());
    write<4>({static_cast<double>(controller->primitive()), controller->time(), controller->phase(),
              static_cast<double>(controller->finished())});
  }
}

int main(int, char** words) {
  const std::string name = words[1];
  if (name == "felt") {
    run<skill_felt::Controller, skill_felt::Durations, skill_felt::Goals>();
  } else if (name == "plain") {
    run<skill_plain::Controller, skill_plain::Durations, skill_plain::Goals>();
  } else {
    run<skill_strange::Controller, skill_strange::Durations, skill_strange::Goals>();
  }
}
