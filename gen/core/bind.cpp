// bind.cpp - the Python face of the C++ core: arrays in, arrays out. Types in gyrotc/_core.pyi.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "evidence.hpp"
#include "kohonen.hpp"
#include "varpro.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace gyrotc;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

void same_length(std::initializer_list<Eigen::Index> sizes) {
    for (const Eigen::Index n : sizes)
        if (n != *sizes.begin()) throw nb::value_error("arrays differ in length");
}

Bins bins(VectorXd t, VectorXd r, VectorXd count, VectorXd mean, double within, double samples) {
    same_length({t.size(), r.size(), count.size(), mean.size()});
    return {std::move(t), std::move(r), std::move(count), std::move(mean), within, samples};
}

VariableProjection projection(VectorXd t, VectorXd r, VectorXd weight, VectorXd target, double ridge) {
    same_length({t.size(), r.size(), weight.size(), target.size()});
    return VariableProjection({std::move(t), std::move(r), std::move(weight), std::move(target)}, ridge);
}

}  // namespace

NB_MODULE(_core, m) {
    m.doc() = "C++ core of gyrotc: Kohonen network, evidence model, variable projection.";

    nb::class_<KohonenMap>(m, "KohonenMap")
        .def_ro("nodes", &KohonenMap::nodes)
        .def_ro("occupancy", &KohonenMap::occupancy)
        .def_ro("epochs", &KohonenMap::epochs);
    m.def(
        "kohonen",
        [](const MatrixXd &samples, int nodes, int max_epochs, double rate_first, double rate_last, double tolerance,
           std::uint64_t seed) {
            return kohonen(samples, {nodes, max_epochs, rate_first, rate_last, tolerance, seed});
        },
        "samples"_a, "nodes"_a, nb::kw_only(), "max_epochs"_a = 30, "rate_first"_a = 0.5, "rate_last"_a = 0.005,
        "tolerance"_a = 1e-4, "seed"_a = 0);

    nb::class_<EvidenceModel>(m, "EvidenceModel")
        .def(
            "__init__",
            [](EvidenceModel *self, VectorXd t, VectorXd r, VectorXd count, VectorXd mean, double within,
               double samples) {
                new (self) EvidenceModel(bins(std::move(t), std::move(r), std::move(count), std::move(mean), within,
                                              samples));
            },
            "t"_a, "r"_a, "count"_a, "mean"_a, "within"_a, "samples"_a)
        .def("objective",
             [](const EvidenceModel &self, const EvidenceParameters &p) {
                 EvidenceParameters gradient;
                 const double value = self.objective(p, &gradient);
                 return std::make_tuple(value, gradient);
             })
        .def("optimise", [](EvidenceModel &self) { self.optimise(); })
        .def("optimise_from", [](EvidenceModel &self, const EvidenceParameters &start) { self.optimise(&start); })
        .def("condition", &EvidenceModel::condition)
        .def("mean", &EvidenceModel::mean, "t"_a, "r"_a)
        .def("variance", &EvidenceModel::variance, "t"_a, "r"_a)
        .def_prop_ro("log_parameters", [](const EvidenceModel &self) { return self.log_parameters(); })
        .def_prop_ro("sigma", &EvidenceModel::sigma)
        .def_prop_ro("freedom", &EvidenceModel::freedom)
        .def_prop_ro("value", &EvidenceModel::value)
        .def_prop_ro("evaluations", &EvidenceModel::evaluations);

    nb::class_<Network>(m, "Network")
        .def_ro("shapes", &Network::shapes)
        .def_ro("weights", &Network::weights)
        .def_ro("cost", &Network::cost)
        .def_ro("misfit", &Network::misfit);
    nb::class_<VariableProjection>(m, "VariableProjection")
        .def(
            "__init__",
            [](VariableProjection *self, VectorXd t, VectorXd r, VectorXd weight, VectorXd target, double ridge) {
                new (self) VariableProjection(
                    projection(std::move(t), std::move(r), std::move(weight), std::move(target), ridge));
            },
            "t"_a, "r"_a, "weight"_a, "target"_a, "ridge"_a)
        .def("project", &VariableProjection::project, "shapes"_a)
        .def("gradient", &VariableProjection::gradient, "network"_a)
        .def("refine", &VariableProjection::refine, "start"_a, "tolerance"_a, "max_steps"_a)
        .def("path", &VariableProjection::path, "centers"_a, "max_size"_a, "enough"_a, "tolerance"_a);
}
