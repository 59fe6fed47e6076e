
#include <eml_net.h>
static const float mynet_layer_0_biases[16] = { 0.565209f, -0.488142f, -0.555654f, 1.557384f, 1.972235f, 1.440536f, 0.314336f, -0.250963f, 1.032474f, -0.665141f, 0.230866f, -0.811704f, -0.671224f, 1.603128f, -0.708470f, -0.817038f };
static const float mynet_layer_0_weights[32] = { -1.325166f, 2.335444f, 0.118647f, -2.173927f, -1.746738f, 1.865211f, 0.910587f, 1.343484f, 2.850662f, 0.171577f, 0.150800f, -0.502413f, 0.319765f, -0.210810f, -1.715556f, -0.122074f, -1.683635f, 0.127080f, 0.321151f, 0.047640f, -0.180972f, -0.201285f, -0.212300f, -0.227131f, 0.038949f, 1.424457f, -0.505245f, 1.491132f, -1.327075f, -0.751432f, -0.472892f, 0.024066f };
static const float mynet_layer_1_biases[1] = { -0.996257f };
static const float mynet_layer_1_weights[16] = { -0.387406f, -1.792757f, 0.083397f, 3.382542f, -2.336640f, -0.756649f, 0.431898f, -0.694354f, 2.677103f, -0.775192f, 0.051648f, -0.747865f, 0.903542f, -0.825921f, 0.484972f, -0.378232f };
static float mynet_buf1[16];
static float mynet_buf2[16];
static const EmlNetLayer mynet_layers[2] = { 
{ 16, 2, mynet_layer_0_weights, mynet_layer_0_biases, EmlNetActivationRelu }, 
{ 1, 16, mynet_layer_1_weights, mynet_layer_1_biases, EmlNetActivationIdentity } };
static EmlNet mynet = { 2, mynet_layers, mynet_buf1, mynet_buf2, 16 };

    int32_t
    mynet_predict(const float *features, int32_t n_features)
    {
        return eml_net_predict(&mynet, features, n_features);
    }
    

    int32_t
    mynet_regress(const float *features, int32_t n_features, float *out, int32_t out_length)
    {
        return eml_net_regress(&mynet, features, n_features, out, out_length);
    }
    

    float
    mynet_regress1(const float *features, int32_t n_features)
    {
        return eml_net_regress1(&mynet, features, n_features);
    }
    