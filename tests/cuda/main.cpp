// Runs the tests three times: the threads of a block begin in their order, in the reverse, and shuffled.
#include <gtest/gtest.h>

#include "runtime/cuda_on_cpu.h"

namespace {

struct Orders : testing::EmptyTestEventListener {
  void OnTestIterationStart(const testing::UnitTest&, int iteration) override {
    constexpr cuda_on_cpu::Order kOrders[] = {cuda_on_cpu::Order::kForward, cuda_on_cpu::Order::kBackward,
                                              cuda_on_cpu::Order::kShuffled};
    cuda_on_cpu::set_order(kOrders[iteration % 3]);
  }
};

}  // namespace

int main(int argc, char** argv) {
  testing::GTEST_FLAG(repeat) = 3;
  testing::InitGoogleTest(&argc, argv);
  testing::UnitTest::GetInstance()->listeners().Append(new Orders);
  return RUN_ALL_TESTS();
}
