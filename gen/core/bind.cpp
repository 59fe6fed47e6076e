// bind.cpp - the Python face of the C++ core: arrays in, arrays out. Types in gyrotc/_core.pyi.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>

#include "equal_gaussians.hpp"
#include "kohonen.hpp"
#include "ols.hpp"
#include "posteriors.hpp"
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

Samples samples(VectorXd t, VectorXd r, VectorXd y, VectorXd weight) {
    same_length({t.size(), r.size(), y.size(), weight.size()});
    return {std::move(t), std::move(r), std::move(y), std::move(weight)};
}

VariableProjection projection(VectorXd t, VectorXd r, VectorXd weight, VectorXd target, double ridge) {
    same_length({t.size(), r.size(), weight.size(), target.size()});
    return VariableProjection({std::move(t), std::move(r), std::move(weight), std::move(target)}, ridge);
}

using Stack = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// The numbers as an array that owns them.
template <typename T>
nb::ndarray<nb::numpy, T, nb::ndim<1>> array_of(std::vector<T> numbers) {
    auto *kept = new std::vector<T>(std::move(numbers));
    const nb::capsule owner(kept, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return {kept->data(), {kept->size()}, owner};
}

}  // namespace

NB_MODULE(_core, m) {
    m.doc() = "C++ core of gyrotc: Kohonen network, orthogonal least squares, variable projection.";
#if defined(__clang__)
    m.attr("compiler") = __VERSION__;
#elif defined(__GNUC__)
    m.attr("compiler") = "GCC " __VERSION__;
#else
    m.attr("compiler") = "another";
#endif

    nb::class_<KohonenMap>(m, "KohonenMap")
        .def_ro("nodes", &KohonenMap::nodes)
        .def_ro("occupancy", &KohonenMap::occupancy)
        .def_ro("epochs", &KohonenMap::epochs);
    m.def(
        "kohonen",
        [](const MatrixXd &samples, int nodes, int max_epochs, double rate_first, double rate_last, double tolerance,
           double neighbourhood, std::uint64_t seed) {
            return kohonen(samples, {nodes, max_epochs, rate_first, rate_last, tolerance, neighbourhood, seed});
        },
        "samples"_a, "nodes"_a, nb::kw_only(), "max_epochs"_a = 30, "rate_first"_a = 0.5, "rate_last"_a = 0.005,
        "tolerance"_a = 1e-4, "neighbourhood"_a = 0.0, "seed"_a = 0);

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
        .def("losses", nb::overload_cast<const Shapes &>(&VariableProjection::losses, nb::const_), "shapes"_a)
        .def("refine", &VariableProjection::refine, "start"_a, "tolerance"_a, "max_steps"_a)
        .def("path", &VariableProjection::path, "centers"_a, "max_size"_a, "enough"_a, "settled"_a,
             "tolerance"_a);

    nb::class_<Samples>(m, "Samples")
        .def(
            "__init__",
            [](Samples *self, VectorXd t, VectorXd r, VectorXd y, VectorXd weight) {
                new (self) Samples(samples(std::move(t), std::move(r), std::move(y), std::move(weight)));
            },
            "t"_a, "r"_a, "y"_a, "weight"_a);
    nb::class_<NormalEquations>(m, "NormalEquations")
        .def("norms", &NormalEquations::norms)
        .def("moments", &NormalEquations::moments)
        .def("column", &NormalEquations::column, "j"_a)
        .def_prop_ro("energy", &NormalEquations::energy);
    nb::class_<DenseColumns, NormalEquations>(m, "DenseColumns")
        .def(
            "__init__",
            [](DenseColumns *self, MatrixXd columns, const VectorXd &y) {
                same_length({columns.rows(), y.size()});
                new (self) DenseColumns(std::move(columns), y);
            },
            "columns"_a, "y"_a);
    nb::class_<EqualGaussians, NormalEquations>(m, "EqualGaussians")
        .def_static(
            "on_grid",
            [](double t_first, double t_step, Eigen::Index t_count, double r_first, double r_step,
               Eigen::Index r_count, double width_t, double width_r) {
                return EqualGaussians::on_grid({t_first, t_step, t_count}, {r_first, r_step, r_count}, width_t,
                                               width_r);
            },
            "t_first"_a, "t_step"_a, "t_count"_a, "r_first"_a, "r_step"_a, "r_count"_a, "width_t"_a, "width_r"_a)
        .def_static("at", &EqualGaussians::at, "centers"_a, "width_t"_a, "width_r"_a)
        .def("add", &EqualGaussians::add, "samples"_a)
        .def_prop_ro("centers", &EqualGaussians::centers)
        .def_prop_ro("samples", &EqualGaussians::samples);
    nb::class_<OlsPath>(m, "OlsPath")
        .def_ro("chosen", &OlsPath::chosen)
        .def_ro("reduction", &OlsPath::reduction)
        .def_ro("rest", &OlsPath::rest);
    m.def(
        "select_columns",
        [](const NormalEquations &dictionary, Eigen::Index max_columns, double rho, double guard, Eigen::Index given,
           bool in_order) { return select_columns(dictionary, {max_columns, rho, guard, given, in_order}); },
        "dictionary"_a, "max_columns"_a, nb::kw_only(), "rho"_a = 0.0, "guard"_a = 1e-7, "given"_a = 1,
        "in_order"_a = false);
    m.def("least_squares", &least_squares, "samples"_a, "gaussians"_a, "ridge"_a);
    m.def(
        "posteriors",
        [](const MatrixXd &prior, const Stack &precision) {
            const std::size_t units = precision.shape(0), n = precision.shape(1);
            same_length({static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(precision.shape(2)), prior.rows(),
                         prior.cols()});
            auto covariance = std::make_unique<double[]>(units * n * n);
            std::vector<double> log_determinant(units);
            {
                const nb::gil_scoped_release released;
                posteriors(prior, precision.data(), static_cast<Eigen::Index>(units), covariance.get(),
                           log_determinant.data());
            }
            double *kept = covariance.release();
            const nb::capsule owner(kept, [](void *p) noexcept { delete[] static_cast<double *>(p); });
            return std::make_tuple(nb::ndarray<nb::numpy, double, nb::ndim<3>>(kept, {units, n, n}, owner),
                                   array_of(std::move(log_determinant)));
        },
        "prior"_a, "precision"_a);
}
