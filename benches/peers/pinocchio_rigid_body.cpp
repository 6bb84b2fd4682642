// Times Pinocchio on one serial chain of revolute joints: median nanoseconds of a call, over many batches.
//
// Reads the chain and a state as numbers from standard input (`run` writes them) and prints, for each algorithm, a line
// with its name, the median and the result, so that the caller can check that both sides computed the same arm.
// Pinocchio's algorithms are templates: nothing but headers is needed, and everything is compiled for this processor.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/math.hpp>
#include <pinocchio/multibody.hpp>

namespace {

constexpr int CALLS_PER_BATCH = 200;
constexpr int BATCHES = 5000;

double number() {
    double value;
    if (!(std::cin >> value)) throw std::runtime_error("standard input ends before the chain and its state do");
    return value;
}

Eigen::VectorXd numbers(int count) {
    Eigen::VectorXd values(count);
    for (double& value : values) value = number();
    return values;
}

// The fastest joint type Pinocchio has for an axis.
pinocchio::JointModel revolute(const Eigen::Vector3d& axis) {
    if (axis == Eigen::Vector3d::UnitX()) return pinocchio::JointModelRX();
    if (axis == Eigen::Vector3d::UnitY()) return pinocchio::JointModelRY();
    if (axis == Eigen::Vector3d::UnitZ()) return pinocchio::JointModelRZ();
    return pinocchio::JointModelRevoluteUnaligned(axis.normalized());
}

pinocchio::Inertia inertia() {
    const double mass_kg = number();
    const Eigen::Vector3d centre_m = numbers(3);
    const double xx = number(), yy = number(), zz = number(), xy = number(), yz = number(), xz = number();
    Eigen::Matrix3d about_centre_kg_m2;
    about_centre_kg_m2 << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    return {mass_kg, centre_m, about_centre_kg_m2};
}

pinocchio::Model chain() {
    const int joint_count = static_cast<int>(number());
    pinocchio::Model model;
    model.gravity.linear() = numbers(3);
    pinocchio::JointIndex joint = 0;
    for (int index = 0; index < joint_count; ++index) {
        const Eigen::Vector3d origin_m = numbers(3), rpy_rad = numbers(3), axis = numbers(3);
        const pinocchio::SE3 origin(pinocchio::rpy::rpyToMatrix(rpy_rad), origin_m);
        joint = model.addJoint(joint, revolute(axis), origin, std::to_string(index));
        model.appendBodyToJoint(joint, inertia(), pinocchio::SE3::Identity());
    }
    return model;
}

template <typename Call>
double median_ns(const Call& call) {
    std::vector<double> batches_ns;
    for (int batch = 0; batch < BATCHES; ++batch) {
        const auto start = std::chrono::steady_clock::now();
        for (int repeat = 0; repeat < CALLS_PER_BATCH; ++repeat) {
            asm volatile("" : : "r"(&call()) : "memory");  // neither the inputs nor the result may be assumed
        }
        const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - start;
        batches_ns.push_back(taken.count() / CALLS_PER_BATCH);
    }
    const auto middle = batches_ns.begin() + BATCHES / 2;
    std::nth_element(batches_ns.begin(), middle, batches_ns.end());
    return *middle;
}

template <typename Call>
void report(const char* name, const Call& call) {
    std::printf("%s %.1f", name, median_ns(call));
    for (const double value : call()) std::printf(" %.17g", value);
    std::printf("\n");
}

}  // namespace

int main() try {
    const pinocchio::Model model = chain();
    pinocchio::Data data(model);
    const Eigen::VectorXd q = numbers(model.nq), v = numbers(model.nv), a = numbers(model.nv), tau = numbers(model.nv);
    report("inverse_dynamics", [&]() -> const Eigen::VectorXd& { return pinocchio::rnea(model, data, q, v, a); });
    report("gravity_torque",
           [&]() -> const Eigen::VectorXd& { return pinocchio::computeGeneralizedGravity(model, data, q); });
    report("forward_dynamics", [&]() -> const Eigen::VectorXd& { return pinocchio::aba(model, data, q, v, tau); });
} catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
