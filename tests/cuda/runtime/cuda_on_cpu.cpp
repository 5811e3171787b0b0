// The threads of a block as fibers. This file is built without ThreadSanitizer, which would take what the fibers and their
// scheduler tell each other for a race.
#include "cuda_on_cpu.h"

#include <sys/mman.h>
#include <ucontext.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#include <sanitizer/common_interface_defs.h>
#endif
#if defined(CUDA_ON_CPU_FINDS_RACES)
#include <sanitizer/tsan_interface.h>
#endif

namespace cuda_on_cpu {
namespace {

constexpr int kWarp = 32, kMostThreads = 1024, kMostBlocksInY = 65535;
constexpr size_t kMostSharedBytes = 227 * 1024,
                 kSharedBytesUnasked = 48 * 1024;  // of a block, on compute capability 9.0
constexpr size_t kGap = 64;                        // bytes between variables in shared memory, at least
constexpr size_t kArena = kMostSharedBytes + 16 * kGap;
constexpr size_t kStackBytes = 64 * 1024;

enum class State { kReady, kWaiting, kDone };

struct Fiber {
  Place place;
  State state;
  Operation operation;
  CallSite site;
  unsigned mask;
  uint64_t value, result;
  int from;
  ucontext_t context;
  char* stack;
  void* of_sanitizer;  // a fake stack, or a fiber
};

struct Failure {
  std::string message;
};

char* map_stacks(size_t n) {
  constexpr int kFlags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE;
  void* const memory = mmap(nullptr, n * kStackBytes, PROT_READ | PROT_WRITE, kFlags, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  return static_cast<char*>(memory);
}

// ---- what sanitizers are told ----

#if defined(CUDA_ON_CPU_FINDS_RACES)
// New memory for each block: what another block's thread left on its stack is no race.
char* take_stacks(size_t n) { return map_stacks(n); }
void give_stacks_back(char* stacks, size_t n) { munmap(stacks, n * kStackBytes); }
// A launch is before all of its blocks, and all of them are before what follows it; but one block is not before another. So who
// begins the blocks is not who waits for them.
struct Beginner {
  Beginner() { __tsan_switch_to_fiber(fiber, __tsan_switch_to_fiber_no_sync); }
  ~Beginner() { __tsan_switch_to_fiber(waiting, __tsan_switch_to_fiber_no_sync); }

  static void* fiber;
  void* waiting = __tsan_get_current_fiber();
};
void* Beginner::fiber;
void begin_launch() { Beginner::fiber = __tsan_create_fiber(0); }
void end_launch() { __tsan_destroy_fiber(Beginner::fiber); }
void* begin_fiber() { return __tsan_create_fiber(0); }
void end_fiber(Fiber& fiber) { __tsan_destroy_fiber(fiber.of_sanitizer); }
void release(void* at) { __tsan_release(at); }
void acquire(void* at) { __tsan_acquire(at); }
#else
char* take_stacks(size_t) {
  static char* const stacks = map_stacks(kMostThreads);
  return stacks;
}
void give_stacks_back(char*, size_t) {}
struct Beginner {
  Beginner() {}
};
void begin_launch() {}
void end_launch() {}
void* begin_fiber() { return nullptr; }
void end_fiber(Fiber&) {}
void release(void*) {}
void acquire(void*) {}
#endif

// ---- a block ----

class Block {
 public:
  Block(const std::function<void()>& thread, dim3 number, dim3 grid, dim3 size, size_t dynamic_bytes, Order order)
      : thread_(thread), dynamic_bytes_(dynamic_bytes) {
    const Beginner begins;
    fibers_.resize(size_t(size.x) * size.y * size.z);
    meeting_.resize(kMostThreads / kWarp + 1);
    memory_.reset(static_cast<char*>(std::aligned_alloc(64, kArena)));
    std::memset(memory_.get(), 0xff, kArena);  // NaN, -1
    hide(memory_.get(), kArena);
    dynamic_ = dynamic_bytes ? take(dynamic_bytes) : nullptr;
    stacks_ = take_stacks(fibers_.size());
    order_.resize(fibers_.size());
    std::iota(order_.begin(), order_.end(), 0);
    if (order == Order::kBackward) std::reverse(order_.begin(), order_.end());
    if (order == Order::kShuffled) std::shuffle(order_.begin(), order_.end(), std::mt19937(number.x + 1));
    for (size_t i = 0; i < fibers_.size(); ++i) {
      Fiber& fiber = fibers_[i];
      const unsigned t = unsigned(i);
      fiber.place = {{t % size.x, t / size.x % size.y, t / size.x / size.y}, number, size, grid};
      fiber.state = State::kReady;
      fiber.stack = stacks_ + i * kStackBytes;
      fiber.of_sanitizer = begin_fiber();
      getcontext(&fiber.context);
      fiber.context.uc_stack.ss_sp = fiber.stack, fiber.context.uc_stack.ss_size = kStackBytes;
      fiber.context.uc_link = nullptr;
      makecontext(&fiber.context, &Block::enter, 0);
    }
  }
  ~Block() {
    acquire(&end_);
    for (Fiber& fiber : fibers_) end_fiber(fiber);
    show(memory_.get(), kArena);
    show(stacks_, fibers_.size() * kStackBytes);
    give_stacks_back(stacks_, fibers_.size());
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  // Runs all threads to their ends; throws Failure where they cannot come there.
  void run();
  // A thread waits until what it waits for has come.
  void wait(Operation operation, unsigned mask, uint64_t value, int from, CallSite site);

  void* variable(const void* name, size_t bytes) {
    auto& at = variables_[name];
    return at ? at : at = take(bytes);
  }
  void* dynamic() const { return dynamic_; }

  static Block* running;
  Fiber* current = nullptr;
  size_t static_bytes() const { return used_ - dynamic_bytes_; }

 private:
  static void enter();
  static void hide([[maybe_unused]] void* at, [[maybe_unused]] size_t bytes) {
#if defined(__SANITIZE_ADDRESS__)
    __asan_poison_memory_region(at, bytes);
#endif
  }
  static void show([[maybe_unused]] void* at, [[maybe_unused]] size_t bytes) {
#if defined(__SANITIZE_ADDRESS__)
    __asan_unpoison_memory_region(at, bytes);
#endif
  }
  void* take(size_t bytes) {
    char* const at = memory_.get() + taken_;
    taken_ += (bytes + kGap + 63) / 64 * 64, used_ += bytes;
    if (taken_ > kArena) {  // a fiber cannot throw to its scheduler
      std::fprintf(stderr, "cuda_on_cpu: %zu bytes of shared memory, more than a block can have\n", used_);
      std::abort();
    }
    show(at, bytes);
    return at;
  }
  void resume(Fiber& fiber);
  void leave(bool for_good);
  bool meet_warps();
  bool meet_all();
  [[noreturn]] void fail(const Fiber& fiber, const std::string& why) const;

  struct Free {
    void operator()(char* memory) const { std::free(memory); }
  };
  const std::function<void()>& thread_;
  std::vector<Fiber> fibers_;
  std::vector<int> order_;
  std::unique_ptr<char, Free> memory_;
  std::map<const void*, void*> variables_;
  void* dynamic_ = nullptr;
  size_t dynamic_bytes_, taken_ = 0, used_ = 0;
  char* stacks_;
  ucontext_t scheduler_;
  // Addresses that stand for the warps and for the block, in memory of its own, so that no other block has them; and for its end.
  std::vector<char> meeting_;
  char end_;
#if defined(__SANITIZE_ADDRESS__)
  void* fake_stack_ = nullptr;
  const void* scheduler_stack_ = nullptr;
  size_t scheduler_stack_bytes_ = 0;
#endif
#if defined(CUDA_ON_CPU_FINDS_RACES)
  void* of_scheduler_ = __tsan_get_current_fiber();
#endif
};

Block* Block::running = nullptr;

void Block::enter() {
  Block& block = *running;
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_finish_switch_fiber(nullptr, &block.scheduler_stack_, &block.scheduler_stack_bytes_);
#endif
  block.thread_();
  block.current->state = State::kDone;
  block.leave(true);
}

void Block::resume(Fiber& fiber) {
  current = &fiber;
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_start_switch_fiber(&fake_stack_, fiber.stack, kStackBytes);
#endif
#if defined(CUDA_ON_CPU_FINDS_RACES)
  __tsan_switch_to_fiber(fiber.of_sanitizer, __tsan_switch_to_fiber_no_sync);
#endif
  swapcontext(&scheduler_, &fiber.context);
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_finish_switch_fiber(fake_stack_, nullptr, nullptr);
#endif
  current = nullptr;
}

void Block::leave([[maybe_unused]] bool for_good) {
  Fiber& fiber = *current;
  release(&end_);
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_start_switch_fiber(for_good ? nullptr : &fiber.of_sanitizer, scheduler_stack_, scheduler_stack_bytes_);
#endif
#if defined(CUDA_ON_CPU_FINDS_RACES)
  __tsan_switch_to_fiber(of_scheduler_, __tsan_switch_to_fiber_no_sync);
#endif
  swapcontext(&fiber.context, &scheduler_);
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_finish_switch_fiber(fiber.of_sanitizer, &scheduler_stack_, &scheduler_stack_bytes_);
#endif
}

void Block::wait(Operation operation, unsigned mask, uint64_t value, int from, CallSite site) {
  Fiber& fiber = *current;
  fiber.state = State::kWaiting, fiber.operation = operation, fiber.mask = mask, fiber.value = value, fiber.from = from;
  fiber.site = site;
  // A shuffle and a ballot order nothing in memory.
  const bool orders = operation == Operation::kBarrier || operation == Operation::kWarpBarrier;
  const ptrdiff_t warp = (&fiber - fibers_.data()) / kWarp;
  void* const meeting = &meeting_[operation == Operation::kBarrier ? kMostThreads / kWarp : warp];
  if (orders) release(meeting);
  leave(false);
  if (orders) acquire(meeting);
}

bool same(const Fiber& a, const Fiber& b) {
  return a.operation == b.operation && a.site.line == b.site.line && std::strcmp(a.site.file, b.site.file) == 0;
}
std::string place_of(CallSite site) {
  const char* name = std::strrchr(site.file, '/');
  return std::string(name ? name + 1 : site.file) + ":" + std::to_string(site.line);
}
const char* name_of(Operation operation) {
  switch (operation) {
    case Operation::kBarrier:
      return "__syncthreads";
    case Operation::kWarpBarrier:
      return "__syncwarp";
    case Operation::kShuffle:
      return "a shuffle";
    case Operation::kBallot:
      return "a ballot";
  }
  return "";
}

void Block::fail(const Fiber& fiber, const std::string& why) const {
  const auto three = [](dim3 v) {
    return "(" + std::to_string(v.x) + ", " + std::to_string(v.y) + ", " + std::to_string(v.z) + ")";
  };
  throw Failure{"block " + three(fiber.place.block) + ", thread " + three(fiber.place.thread) + ": " +
                name_of(fiber.operation) + " at " + place_of(fiber.site) + " " + why};
}

// Lanes of a warp that all wait for each other go on, with what they asked for.
bool Block::meet_warps() {
  bool met = false;
  for (size_t first = 0; first < fibers_.size(); first += kWarp) {
    Fiber* const lanes = &fibers_[first];
    const int n = int(std::min<size_t>(kWarp, fibers_.size() - first));
    for (int i = 0; i < n; ++i) {
      Fiber& one = lanes[i];
      if (one.state != State::kWaiting || one.operation == Operation::kBarrier) continue;
      if (!(one.mask >> i & 1u)) fail(one, "is called by a lane that its mask leaves out");
      unsigned there = 0;
      for (int j = 0; j < n; ++j) {
        const Fiber& other = lanes[j];
        if (!(one.mask >> j & 1u) || other.state == State::kDone) continue;
        if (other.state != State::kWaiting || !same(one, other) || other.mask != one.mask)
          fail(one, "waits for lane " + std::to_string(j) + ", which is at " + name_of(other.operation) + " at " +
                        place_of(other.site));
        there |= 1u << j;
      }
      unsigned yes = 0;
      for (int j = 0; j < n; ++j) yes |= there >> j & 1u ? unsigned(lanes[j].value != 0) << j : 0u;
      for (int j = 0; j < n; ++j) {
        if (!(there >> j & 1u)) continue;
        Fiber& lane = lanes[j];
        if (lane.operation == Operation::kShuffle) {
          if (!(there >> lane.from & 1u)) fail(lane, "asks lane " + std::to_string(lane.from) + ", which says nothing");
          lane.result = lanes[lane.from].value;
        } else {
          lane.result = yes;
        }
      }
      for (int j = 0; j < n; ++j)
        if (there >> j & 1u) lanes[j].state = State::kReady;
      met = true;
      break;
    }
  }
  return met;
}

// All threads that have not ended wait at one barrier, and go on.
bool Block::meet_all() {
  Fiber* first = nullptr;
  for (Fiber& fiber : fibers_) {
    if (fiber.state == State::kDone) continue;
    if (!first) first = &fiber;
    if (!same(*first, fiber))
      fail(fiber, "waits while thread " + std::to_string(first->place.thread.x) + " is at " +
                      name_of(first->operation) + " at " + place_of(first->site));
  }
  for (Fiber& fiber : fibers_)
    if (fiber.state == State::kWaiting) fiber.state = State::kReady;
  return first != nullptr;
}

void Block::run() {
  running = this;
  do {
    for (const int i : order_)
      if (fibers_[i].state == State::kReady) resume(fibers_[i]);
  } while (meet_warps() || meet_all());
  running = nullptr;
}

std::string last_error;
Order order = Order::kForward;
std::map<const void*, size_t> allowed;  // bytes of dynamic shared memory, by kernel

}  // namespace

Place& here() { return Block::running->current->place; }
int lane() {
  const Place& at = here();
  return int((at.thread.x + at.block_size.x * (at.thread.y + at.block_size.y * at.thread.z)) % kWarp);
}
void barrier(CallSite site) { Block::running->wait(Operation::kBarrier, 0, 0, 0, site); }
uint64_t exchange(Operation operation, unsigned mask, uint64_t value, int from, CallSite site) {
  Fiber& fiber = *Block::running->current;
  Block::running->wait(operation, mask, value, from, site);
  return fiber.result;
}
uint32_t ballot(unsigned mask, bool yes, CallSite site) {
  return uint32_t(exchange(Operation::kBallot, mask, yes, 0, site));
}
void* shared_memory(const void* variable, size_t bytes) { return Block::running->variable(variable, bytes); }
void* dynamic_shared_memory() { return Block::running->dynamic(); }
void set_order(Order wanted) { order = wanted; }
void allow_shared_memory(const void* kernel, int bytes) { allowed[kernel] = size_t(bytes); }

Counts counts{};
Counts take_counts() { return std::exchange(counts, Counts{}); }
void count_atomic() { ++counts.atomics; }

void run(const void* kernel, dim3 grid, dim3 block, size_t bytes, const std::function<void()>& thread) {
  const size_t asked = allowed.count(kernel) ? allowed.at(kernel) : 0;
  const size_t n_threads = size_t(block.x) * block.y * block.z;
  if (grid.x == 0 || grid.y == 0 || grid.z == 0 || n_threads == 0) {
    last_error = "a launch of no threads";
  } else if (n_threads > kMostThreads || grid.y > kMostBlocksInY || grid.z > kMostBlocksInY || grid.x > 0x7fffffffu) {
    last_error = "a launch of more threads than a block, or of more blocks than a grid can have";
  } else if (bytes > std::max(kSharedBytesUnasked, asked)) {
    last_error = "more shared memory than was allowed for the kernel";
  }
  if (!last_error.empty()) return;
  ++counts.launches;
  begin_launch();
  try {
    for (unsigned z = 0; z < grid.z; ++z)
      for (unsigned y = 0; y < grid.y; ++y)
        for (unsigned x = 0; x < grid.x; ++x) {
          Block one(thread, {x, y, z}, grid, block, bytes, order);
          one.run();
          if (one.static_bytes() + bytes > std::max(kSharedBytesUnasked, one.static_bytes() + asked) ||
              one.static_bytes() > kSharedBytesUnasked)
            throw Failure{"more shared memory, with that of variables, than was allowed"};
        }
  } catch (const Failure& failure) {
    last_error = failure.message;
    Block::running = nullptr;
  }
  end_launch();
}

}  // namespace cuda_on_cpu

namespace {
std::string told;
}

cudaError_t cudaGetLastError() {
  told = cuda_on_cpu::last_error;
  cuda_on_cpu::last_error.clear();
  return told.empty() ? cudaSuccess : cudaErrorLaunchFailure;
}
const char* cudaGetErrorString(cudaError_t) { return told.c_str(); }
cudaError_t cudaSetDevice(int device) { return device == 0 ? cudaSuccess : cudaErrorInvalidValue; }
cudaError_t cudaGetDevice(int* device) {
  *device = 0;
  return cudaSuccess;
}
cudaError_t cudaDeviceGetAttribute(int* value, cudaDeviceAttr, int) {
  *value = int(cuda_on_cpu::kMostSharedBytes);
  return cudaSuccess;
}
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind, cudaStream_t) {
  std::memcpy(to, from, bytes);
  return cudaSuccess;
}
cudaError_t cudaMemsetAsync(void* to, int value, size_t bytes, cudaStream_t) {
  std::memset(to, value, bytes);
  return cudaSuccess;
}
cudaError_t cudaStreamSynchronize(cudaStream_t) { return cudaSuccess; }
