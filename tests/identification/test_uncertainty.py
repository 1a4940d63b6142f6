"""What measurements say of parameters, in closed form: straight lines, products, quotients, and what is
not seen at all."""

import numpy as np
import pytest

from esail_jax.identification.uncertainty import uncertainty_of


def line(count, end, deviation):
    """The Jacobian of a straight line y = a + b t at equal distances, in units of the noise."""
    t = np.linspace(0.0, end, count)
    return np.stack([np.ones(count), t], axis=1) / deviation


@pytest.mark.parametrize("count", [2, 3, 10, 4001])
def test_the_variance_of_a_slope(count):
    """12 s^2 (N - 1) / (N (N + 1) T^2) for N points at equal distances from 0 to T, exactly; the
    correlation with the other end of the line is that of sum t and sum t^2. Rounding, enlarged by the
    condition of the pair, which is below 15."""
    end, deviation = 7.0, 0.3
    found = uncertainty_of(("a", "b"), np.array([1.0, 2.0]), line(count, end, deviation))
    slope = 12.0 * deviation**2 * (count - 1) / (count * (count + 1) * end**2)
    assert found.covariance[1, 1] == pytest.approx(slope, rel=1e-12)
    assert found.sd[1] == pytest.approx(np.sqrt(slope), rel=1e-12)
    t = np.linspace(0.0, end, count)
    assert found.correlation[0, 1] == pytest.approx(-t.sum() / np.sqrt(count * (t @ t)), rel=1e-12)
    if count > 4000:
        assert slope == pytest.approx(12.0 * deviation**2 / (count * end**2), rel=1e-3)


def of_powers(exponents, values, others=()):
    """The Jacobian of h_k = g_k prod p_i^e_i at values, and columns of other parameters behind it."""
    g = np.linspace(1.0, 2.0, 20)
    columns = [
        g * e * np.prod(np.abs(values) ** exponents) / p for e, p in zip(exponents, values, strict=True)
    ]
    return np.stack([*columns, *others], axis=1)


@pytest.mark.parametrize(
    ("exponents", "values", "words"),
    [
        ([1.0, 1.0], [2.0, 5.0], "their product a b"),
        ([1.0, 2.0], [2.0, 5.0], "their product a^0.5 b"),
        ([2.0, 1.0], [-2.0, 5e6], "their product b^0.5 a"),
        ([1.0, -1.0], [2.0, 5.0], "their quotient a^-1 b"),
        ([3.0, -1.0], [2.0, 5.0], "their quotient b^-0.33 a"),
    ],
)
def test_a_pair_that_is_seen_as_one_is_named_with_its_exponents(exponents, values, words):
    """Only a^e b^f is seen: neither has an error bar, and the text has the exponents, divided by the
    larger one. Of equal weights either may come first."""
    found = uncertainty_of(("a", "b"), np.array(values), of_powers(np.array(exponents), np.array(values)))
    assert np.isinf(found.sd).all() and np.isinf(found.weakest.sd)
    told = found.weakest.words.partition("can be told apart only by ")[2]
    same = abs(exponents[0]) == abs(exponents[1])
    assert told in ((words, words.translate(str.maketrans("ab", "ba"))) if same else (words,))


def test_only_those_that_are_not_seen_have_no_error_bar():
    """Beside a pair of which the product is seen, a third parameter has the error bar that it has when the
    product is one parameter."""
    t = np.linspace(0.0, 1.0, 20)
    pair = of_powers(np.array([1.0, 1.0]), np.array([2.0, 5.0]), [t**2])
    found = uncertainty_of(("a", "b", "c"), np.array([2.0, 5.0, 1.0]), pair)
    alone = uncertainty_of(("ab", "c"), np.array([10.0, 1.0]), pair[:, 1:])
    assert np.isinf(found.sd[:2]).all()
    assert found.sd[2] == pytest.approx(alone.sd[1], rel=1e-9)
    np.testing.assert_allclose(found.correlation, np.eye(3), rtol=0, atol=1e-15)


def test_a_parameter_with_a_small_part_in_what_is_not_seen_has_no_error_bar():
    """c has five per cent of the weight of a and b in the combination that changes nothing: it is not known
    either."""
    a, b = np.random.default_rng(0).standard_normal((2, 20))
    b = a + 0.05 * b
    found = uncertainty_of(("a", "b", "c"), np.ones(3), np.stack([a, b, b - a], axis=1) / [1.0, 1.0, 0.05])
    assert np.isinf(found.sd).all()


def test_a_hundred_and_fifty_parameters_of_which_only_the_sum_is_seen():
    """Each has a small weight in what is not seen, and none an error bar."""
    count = 150
    found = uncertainty_of([f"p{k}" for k in range(count)], np.ones(count), np.ones((200, count)))
    assert np.isinf(found.sd).all()


def test_fewer_measurements_than_parameters():
    """A combination of three numbers is not seen by two measurements, and is the one that is named: its
    image is zero."""
    jacobian = np.array([[1.0, 2.0, 3.0], [1.0, -1.0, 0.5]])
    found = uncertainty_of(("a", "b", "c"), np.full(3, 100.0), jacobian)
    assert np.isinf(found.sd).all() and np.isinf(found.weakest.sd)
    np.testing.assert_allclose(jacobian @ found.weakest.weights, 0.0, atol=1e-12)
    assert found.weakest.words.endswith("is known least: not at all")


def test_parameters_that_are_known_to_very_different_relative_errors_are_all_seen():
    """One is known to 1e-9 of its value, the other to 10 %: both have the error bars of single
    parameters, and the weakest is the second, to ten per cent."""
    jacobian = np.array([[1e9, 0.0], [0.0, 10.0]])
    found = uncertainty_of(("a", "b"), np.array([1.0, 1.0]), jacobian)
    np.testing.assert_allclose(found.sd, [1e-9, 0.1], rtol=1e-12)
    assert found.weakest.words == "b is known least: to 10 %"
    assert found.weakest.sd == pytest.approx(0.1, rel=1e-12)


def test_one_parameter():
    found = uncertainty_of(("a",), np.array([4.0]), np.full((4, 1), 2.0))
    assert found.sd[0] == pytest.approx(0.25, rel=1e-12)
    assert found.weakest[:3] == (("a",), (1.0,), pytest.approx(0.0625, rel=1e-12))
    assert found.weakest.words == "a is known least: to 6.2 %"
    assert found.correlation == 1.0


def test_a_parameter_without_influence_is_not_known_at_all():
    """Beside others, alone, and if none has any."""
    jacobian = np.stack([np.ones(5), np.zeros(5)], axis=1)
    found = uncertainty_of(("a", "b"), np.ones(2), jacobian)
    assert found.sd[0] == pytest.approx(5.0**-0.5, rel=1e-12) and np.isinf(found.sd[1])
    assert found.weakest.words == "b is known least: not at all"
    for count in (1, 2):
        none = uncertainty_of(("a", "b")[:count], np.ones(count), np.zeros((5, count)))
        assert np.isinf(none.sd).all() and np.isinf(none.weakest.sd)
        assert "not at all" in none.weakest.words


def test_a_parameter_that_is_zero_has_no_relative_error():
    """A torque of zero, known to 0.5: it is zero within its error, and known least beside what is known to
    one per cent."""
    found = uncertainty_of(("a", "b"), np.array([0.0, 1.0]), np.diag([2.0, 100.0]))
    np.testing.assert_allclose(found.sd, [0.5, 0.01], rtol=1e-12)
    assert found.weakest.words == "a is known least: it is zero within its error"


def test_the_weakest_combination_has_the_largest_relative_error():
    """Of random Jacobians: the variance of the combination w . dp/|p| is the largest eigenvalue of the
    relative covariance, and w its eigenvector."""
    random = np.random.default_rng(3)
    values = np.array([30.0, -2e-3, 5e6])
    jacobian = random.standard_normal((40, 3)) * 100.0 / np.abs(values)
    found = uncertainty_of(("a", "b", "c"), values, jacobian)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-10)
    weights = np.array(found.weakest.weights)
    relative = covariance / np.outer(np.abs(values), np.abs(values))
    largest = np.linalg.eigvalsh(relative)[-1]
    np.testing.assert_allclose(relative @ weights, largest * weights, rtol=1e-9)
    assert found.weakest.sd == pytest.approx(np.sqrt(largest), rel=1e-10)
