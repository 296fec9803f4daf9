// Durations of ticks of an exported skill: `controller_ticks TICKS` prints a line. Runs follow one
// another from the demonstrations' mean start; every tick has a new sensor sample.
#include <sys/mman.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "skill_measured.hpp"

using namespace skill_measured;

int main(int, char** words) {
  const std::size_t ticks = std::strtoull(words[1], nullptr, 10), warm_up = 10000;
  std::mt19937 generator;
  std::normal_distribution<double> noise(0.0, 10.0);
  std::vector<Sample> samples(1000);
  for (Sample& sample : samples) std::generate(sample.begin(), sample.end(), [&] { return noise(generator); });
  std::vector<double> us(warm_up + ticks);
  Controller controller(1000.0);
  mlockall(MCL_CURRENT | MCL_FUTURE);
  double sum = 0.0;  // of outputs, so that no tick is left out
  for (std::size_t k = 0; k < us.size(); ++k) {
    if (k == 0 || controller.finished()) {
      controller.start(kSkill[0].start.position, kSkill[0].start.orientation);
    }
    const auto begin = std::chrono::steady_clock::now();
    controller.tick(&samples[k % samples.size()]);
    us[k] = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
    sum += controller.position()[0];
  }
  us.erase(us.begin(), us.begin() + static_cast<std::ptrdiff_t>(warm_up));
  std::sort(us.begin(), us.end());
  std::printf("median %.2f us, 99.9 %% within %.2f us, maximum %.1f us, %zu above 20 us (mean x %.3f m)\n",
              us[ticks / 2], us[ticks - 1 - ticks / 1000], us.back(),
              static_cast<std::size_t>(us.end() - std::upper_bound(us.begin(), us.end(), 20.0)),
              sum / static_cast<double>(warm_up + ticks));
}
