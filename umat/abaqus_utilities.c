/* Utility routines that user routines with Abaqus' conventions call: ROTSIG, SINV, SPRINC, XIT.
 *
 * Compile this file into the library of a routine (docs/umat.md). Names are those that Fortran compilers give,
 * in small letters with an underscore behind. Components of symmetric tensors are the NDI direct ones, then the
 * NSHR shears 12, 13, 23; with LSTR = 2 they are strains, whose shears are those of engineering. Definitions are
 * those of the Abaqus User Subroutines Reference Guide; nothing here is Abaqus' own code.
 */
#include <math.h>
#include <stdio.h>

/* Raised by XIT. The program that loaded the library reads it after each call, and ends the run with an error. */
int bondline_umat_failed = 0;

static void unpack(const double *s, int shear_factor, int ndi, int nshr, double t[3][3])
{
    static const int row[3] = {0, 0, 1}, column[3] = {1, 2, 2};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            t[i][j] = 0.0;
    for (int i = 0; i < ndi && i < 3; i++)
        t[i][i] = s[i];
    for (int k = 0; k < nshr && k < 3; k++)
        t[row[k]][column[k]] = t[column[k]][row[k]] = s[ndi + k] / shear_factor;
}

static void pack(double t[3][3], int shear_factor, int ndi, int nshr, double *s)
{
    static const int row[3] = {0, 0, 1}, column[3] = {1, 2, 2};
    for (int i = 0; i < ndi && i < 3; i++)
        s[i] = t[i][i];
    for (int k = 0; k < nshr && k < 3; k++)
        s[ndi + k] = t[row[k]][column[k]] * shear_factor;
}

/* SPRIME = R S R^T; R is stored by columns, as DROT is. */
void rotsig_(const double *s, const double *r, double *sprime, const int *lstr, const int *ndi, const int *nshr)
{
    int factor = *lstr == 2 ? 2 : 1;
    double t[3][3], turned[3][3];
    unpack(s, factor, *ndi, *nshr, t);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            turned[i][j] = 0.0;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++)
                    turned[i][j] += r[i + 3 * k] * t[k][l] * r[j + 3 * l];
        }
    pack(turned, factor, *ndi, *nshr, sprime);
}

/* SINV1 = tr S / 3, SINV2 = sqrt(3/2 dev S : dev S). */
void sinv_(const double *s, double *sinv1, double *sinv2, const int *ndi, const int *nshr)
{
    double t[3][3], sum = 0.0;
    unpack(s, 1, *ndi, *nshr, t);
    double mean = (t[0][0] + t[1][1] + t[2][2]) / 3.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dev = t[i][j] - (i == j ? mean : 0.0);
            sum += dev * dev;
        }
    *sinv1 = mean;
    *sinv2 = sqrt(1.5 * sum);
}

/* Principal values, the largest first, by Jacobi's rotations. */
void sprinc_(const double *s, double *ps, const int *lstr, const int *ndi, const int *nshr)
{
    double t[3][3];
    unpack(s, *lstr == 2 ? 2 : 1, *ndi, *nshr, t);
    for (int sweep = 0; sweep < 50; sweep++) {
        double off = fabs(t[0][1]) + fabs(t[0][2]) + fabs(t[1][2]);
        double size = fabs(t[0][0]) + fabs(t[1][1]) + fabs(t[2][2]);
        if (off <= 1e-17 * size || off == 0.0)
            break;
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (t[p][q] == 0.0)
                    continue;
                double theta = (t[q][q] - t[p][p]) / (2.0 * t[p][q]);
                double tangent = (theta < 0.0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
                double c = 1.0 / sqrt(tangent * tangent + 1.0), z = tangent * c;
                int o = 3 - p - q;
                double pq = t[p][q], po = t[p][o], qo = t[q][o];
                t[p][p] -= tangent * pq;
                t[q][q] += tangent * pq;
                t[p][q] = t[q][p] = 0.0;
                t[p][o] = t[o][p] = c * po - z * qo;
                t[q][o] = t[o][q] = z * po + c * qo;
            }
    }
    for (int i = 0; i < 3; i++)
        ps[i] = t[i][i];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2 - i; j++)
            if (ps[j] < ps[j + 1]) {
                double lesser = ps[j];
                ps[j] = ps[j + 1];
                ps[j + 1] = lesser;
            }
}

/* The routine gives up. In Abaqus XIT does not return; here it does, so that the program can end the run in order:
 * put a RETURN behind CALL XIT where the routine could not go on. */
void xit_(void)
{
    fputs("a user routine called XIT\n", stderr);
    bondline_umat_failed = 1;
}
