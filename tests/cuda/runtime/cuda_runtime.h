// CUDA's header of that name, on the CPU.
#pragma once

#include "cuda_on_cpu.h"
