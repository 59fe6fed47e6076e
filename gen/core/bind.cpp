// bind.cpp - the Python face of the C++ core: arrays in, arrays out.
#include <nanobind/nanobind.h>

NB_MODULE(_core, m) { m.doc() = "C++ core of gyrotc"; }
